"""What a search may change: parameters of a controller by name, with bounds."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any, cast, get_args, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning.gene import Gene, gene_of, plain


class Space:
    """The parameters that a search may change.

    Parameters
    ----------
    **genes
        By the name of a controller's argument: a `Gene`, or ``(low, high)`` with ``"log"`` and
        ``"shared"`` behind it as needed.

    Raises
    ------
    ArgumentError
        No parameter, or bounds that are empty, reversed, not finite, or not positive where the
        scale is logarithmic. Names are checked when the space meets a controller, in `bind`.

    Examples
    --------
    >>> Space(integral_order=(0, 1), kp=(1, 100, "log"), learning_rate=(1, 100, "log", "shared"))
    Space(integral_order=(0, 1), kp=(1, 100, 'log'), learning_rate=(1, 100, 'log', 'shared'))
    """

    def __init__(self, /, **genes: Gene | Sequence[Any] | Mapping[str, Any]) -> None:
        if not genes:
            raise ArgumentError("space", "at least one parameter", "none")
        self.genes: dict[str, Gene] = {name: gene_of(name, given) for name, given in genes.items()}

    def __repr__(self) -> str:
        parts = []
        for name, gene in self.genes.items():
            words = [plain(gene.low), plain(gene.high)]
            words += [repr("log")] if gene.scale == "log" else []
            words += [repr("shared")] if gene.shared else []
            parts.append(f"{name}=({', '.join(words)})")
        return f"Space({', '.join(parts)})"

    def to_dict(self) -> dict[str, Any]:
        """Return the table of the space: plain numbers and strings."""
        return {
            name: {
                "low": np.asarray(gene.low).tolist(),
                "high": np.asarray(gene.high).tolist(),
                "scale": gene.scale,
                "shared": gene.shared,
            }
            for name, gene in self.genes.items()
        }

    def bind(self, controller: Controller, n: int) -> BoundSpace:
        """Meet the controller whose parameters are to change, on an arm with `n` joints.

        Raises
        ------
        ArgumentError
            A name that is none of its numeric parameters (the nearest is given), bounds of a wrong
            length, or bounds that the controller itself refuses.
        """
        return BoundSpace(self, controller, n)


class BoundSpace:
    """A space on one controller: the unit cube [0, 1]^size, a coordinate for each number sought.

    Attributes
    ----------
    n
        Number of joints.
    size
        Number of coordinates.
    labels
        Their names: ``kp.0`` for joint 0 (first), ``kp`` for a shared one.
    """

    def __init__(self, space: Space, controller: Controller, n: int) -> None:
        self.space, self.base, self.n = space, controller, n
        known = _numeric_parameters(controller)
        self._places: dict[str, slice] = {}
        low: list[float] = []
        high: list[float] = []
        labels: list[str] = []
        log: list[bool] = []
        for name, gene in space.genes.items():
            checks.choice(f"space.{name}", name, known)
            count = 1 if gene.shared else n
            self._places[name] = slice(len(low), len(low) + count)
            low += _bounds(f"space.{name}.low", gene.low, count, n).tolist()
            high += _bounds(f"space.{name}.high", gene.high, count, n).tolist()
            labels += [name] if gene.shared else [f"{name}.{joint}" for joint in range(n)]
            log += [gene.scale == "log"] * count
        self.low, self.high = checks.read_only(low), checks.read_only(high)
        self.labels, self._log = tuple(labels), log
        self.size = len(labels)
        for name in space.genes:
            for end, values in (("low", self.low), ("high", self.high)):
                try:
                    self._replace({name: self._member(name, values)})
                except ArgumentError as error:
                    self._require_many(name)
                    raise ArgumentError(f"space.{name}.{end}", error.expected, error.got) from None

    def _require_many(self, name: str) -> None:
        """Refuse to give each joint a value of what all of them have one of."""
        given = getattr(self.base, name)
        given = float(self.high[self._places[name]][0]) if given is None else given
        if self.space.genes[name].shared or np.ndim(given):
            return
        try:
            self._replace({name: np.full(self.n, given)})
        except ArgumentError:
            expected = '"shared" behind its bounds, as all joints have one value'
            raise ArgumentError(f"space.{name}", expected, "none") from None

    def _member(self, name: str, values: FloatArray) -> float | FloatArray:
        part = values[self._places[name]]
        return float(part[0]) if self.space.genes[name].shared else checks.read_only(part)

    def _replace(self, members: Mapping[str, Any]) -> Controller:
        changed = dataclasses.replace(cast("Any", self.base), **members)
        return cast("Controller", changed)

    def values(self, points: FloatArray) -> FloatArray:
        """Map points of the unit cube, (..., size), to parameter values of the same shape."""
        rows = np.asarray(points, dtype=np.float64).reshape(-1, self.size)
        out = np.empty_like(rows)
        for k, log in enumerate(self._log):
            low, high = float(self.low[k]), float(self.high[k])
            for row, x in enumerate(rows[:, k].tolist()):
                # Scalar exp on purpose: numpy's vector exp may round a value differently according
                # to where in an array it stands, and a candidate must not depend on its company.
                value = low * math.exp(x * math.log(high / low)) if log else low + x * (high - low)
                out[row, k] = high if x >= 1.0 else min(max(value, low), high)
        return out.reshape(np.shape(points))

    def at_bounds(self, point: FloatArray) -> tuple[str, ...]:
        """Return the labels of what lies at a bound, or within a hundredth of the range of it."""
        near = np.minimum(point, 1.0 - point) < 0.01
        return tuple(label for label, here in zip(self.labels, near, strict=True) if here)

    def members(self, point: FloatArray) -> dict[str, float | FloatArray]:
        """Return the parameters at a point, (size,), by name: floats where shared, else (n,)."""
        values = self.values(point)
        return {name: self._member(name, values) for name in self.space.genes}

    def controller(self, point: FloatArray, name: str | None = None) -> Controller:
        """Return the controller with the parameters at a point, (size,).

        `name` is given to it where its kind has names.
        """
        members: dict[str, Any] = dict(self.members(point))
        return self._replace(members | self._naming(name))

    def parameters(self, controller: Controller) -> dict[str, float | FloatArray]:
        """Return what a controller has of the parameters sought, by name; NaN: left to it."""
        given = {
            name: np.asarray(getattr(controller, name), dtype=np.float64)
            for name in self.space.genes
        }
        return {name: value if value.ndim else float(value) for name, value in given.items()}

    def renamed(self, name: str) -> Controller:
        """Return the controller that the space was met by, under another name."""
        return self._replace(self._naming(name))

    def _naming(self, name: str | None) -> dict[str, Any]:
        return {} if name is None or not hasattr(self.base, "name") else {"name": name}

    def settings(self, controller: Controller) -> FloatArray:
        """Return what a controller has of the numbers sought, (size,).

        The mean of those that the space has one for; NaN: left to the controller.
        """
        out = np.empty(self.size)
        for name, place in self._places.items():
            value = getattr(controller, name)
            given = np.asarray(np.nan if value is None else value, dtype=np.float64)
            # Learning rates may be a row for each of Kp, Ki, Kd.
            rows = np.broadcast_to(given.mean(axis=0) if given.ndim > 1 else given, (self.n,))
            out[place] = rows.mean() if self.space.genes[name].shared else rows
        return out

    def nearest(self, controller: Controller) -> FloatArray:
        """Return the point at which a controller lies, (size,), moved into the space.

        What is left to the controller is in the middle of its range, for want of another place.
        """
        values = self.settings(controller)
        point = self._coordinates(np.clip(values, self.low, self.high))
        return np.where(np.isnan(values), 0.5, point)

    def point(self, controller: Controller, n: int) -> FloatArray:
        """Return the point at which `controller` lies, (size,).

        Raises
        ------
        ArgumentError
            It lies outside, differs between joints where the space shares, or has no such
            parameters.
        """
        values = np.empty(self.size)
        for name, place in self._places.items():
            if not hasattr(controller, name):
                kind = type(controller).__name__
                raise ArgumentError(f"initial.{name}", f"a controller with {name}", f"a {kind}")
            given = checks.per_joint(f"initial.{name}", getattr(controller, name), n)
            low, high = self.low[place], self.high[place]
            if self.space.genes[name].shared:
                if (given != given[0]).any():
                    raise ArgumentError(f"initial.{name}", "one value for all joints", given)
                given = given[:1]
            if (given < low).any() or (given > high).any():
                raise ArgumentError(f"initial.{name}", f"within {low} and {high}", given)
            values[place] = given
        return self._coordinates(values)

    def _coordinates(self, values: FloatArray) -> FloatArray:
        out = np.empty(self.size)
        for k, value in enumerate(values.tolist()):
            a, b = float(self.low[k]), float(self.high[k])
            part = math.log(value / a) / math.log(b / a) if self._log[k] else (value - a) / (b - a)
            out[k] = min(max(part, 0.0), 1.0)
        return out


def _bounds(name: str, value: ArrayLike, count: int, n: int) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and count == 1 and n > 1:
        raise ArgumentError(name, "a number (the parameter is shared)", f"shape {array.shape}")
    return checks.per_joint(name, array, count if array.ndim == 0 else n)


@cache
def _left_open(cls: type) -> frozenset[str]:
    """Return the arguments that may be a number, or None."""
    hints = get_type_hints(cls)
    return frozenset(name for name, hint in hints.items() if float in get_args(hint))


def _numeric_parameters(controller: Controller) -> list[str]:
    """Return the names of the arguments that hold numbers."""
    if not dataclasses.is_dataclass(controller):
        raise ArgumentError("controller", "a dataclass", type(controller).__name__)
    names = []
    # The law's own before the options that all laws have.
    for field in sorted(dataclasses.fields(controller), key=lambda field: field.kw_only is True):
        value = getattr(controller, field.name)
        if value is None and field.name in _left_open(type(controller)):
            value = 0.0  # a number that was left to the controller
        if isinstance(value, bool) or not isinstance(value, (int, float, np.ndarray, tuple, list)):
            continue
        if field.init and np.asarray(value).dtype.kind in "iuf":
            names.append(field.name)
    return names
