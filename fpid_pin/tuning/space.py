"""What a search may change: parameters of a controller by name, with bounds."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Annotated, Any, get_args, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin.checks import Flag, FloatArray, OneOf, PerJoint
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown


@described("gene")
@dataclasses.dataclass(frozen=True, eq=False)
class Gene(Description):
    """Bounds of one parameter.

    Parameters
    ----------
    low, high
        Scalars, or (n,) for bounds of each joint's own.
    scale
        ``"linear"`` or ``"log"``: where a value lies between its bounds, and so how the first
        population is spread and how far a mutation reaches.
    shared
        One value for all joints; otherwise each joint has its own.
    """

    low: Annotated[ArrayLike, PerJoint()]
    high: Annotated[ArrayLike, PerJoint()]
    scale: Annotated[str, OneOf("linear", "log")] = "linear"
    shared: Annotated[bool, Flag] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        low = checks.floats("low", self.low, above=0.0 if self.scale == "log" else None)
        if not np.all(low < np.asarray(self.high)):
            raise ArgumentError("high", f"more than low ({_brief(low)})", _brief(self.high))


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
        self.genes: dict[str, Gene] = {
            name: _gene(f"space.{name}", given) for name, given in genes.items()
        }

    def __repr__(self) -> str:
        parts = []
        for name, gene in self.genes.items():
            words = [_brief(gene.low), _brief(gene.high)]
            words += ["'log'"] * (gene.scale == "log") + ["'shared'"] * gene.shared
            parts.append(f"{name}=({', '.join(words)})")
        return f"Space({', '.join(parts)})"

    def to_dict(self) -> dict[str, Any]:
        """Return the table of the space: plain numbers and strings."""
        return {name: descriptions.to_dict(gene) for name, gene in self.genes.items()}

    def bind(self, controller: Controller, n: int) -> BoundSpace:
        """Meet the controller whose parameters are to change, on an arm with `n` joints.

        Refused are names that are none of its numeric parameters, bounds of a wrong length, and
        bounds that the controller itself refuses.
        """
        return BoundSpace(self, controller, n)


def _gene(path: str, given: Gene | Sequence[Any] | Mapping[str, Any]) -> Gene:
    """Return the gene that was meant, checked."""
    if isinstance(given, Gene):
        return given
    if not isinstance(given, Mapping):
        expected = 'bounds (low, high), then "log" or "shared" as needed'
        if isinstance(given, str) or not isinstance(given, Sequence) or len(given) < 2:
            raise ArgumentError(path, expected, shown(given))
        words = [checks.choice(path, word, ("linear", "log", "shared")) for word in given[2:]]
        if len(set(words)) < len(words) or {"linear", "log"} <= set(words):
            raise ArgumentError(path, expected, shown(given))
        scale = "log" if "log" in words else "linear"
        low, high = given[:2]
        given = {"low": low, "high": high, "scale": scale, "shared": "shared" in words}
    return descriptions.from_dict(given, Gene, path)


def _brief(bound: ArrayLike) -> str:
    array = np.asarray(bound)
    return f"[{', '.join(f'{x:g}' for x in array)}]" if array.ndim else f"{float(array):g}"


class BoundSpace:
    """A space on one controller: the unit cube [0, 1]^size, a coordinate for each number sought.

    Attributes
    ----------
    base, n
        The controller, and the number of joints.
    size, labels
        Number of coordinates, and their names: ``kp.0`` for joint 0 (first), ``kp`` for a shared
        one.
    low, high
        Their bounds, (size,).
    """

    def __init__(self, space: Space, controller: Controller, n: int) -> None:
        self.space, self.base, self.n = space, controller, n
        known = _numeric_parameters(controller)
        self._places: dict[str, slice] = {}
        low: list[float] = []
        high: list[float] = []
        labels: list[str] = []
        self._log: list[bool] = []
        for name, gene in space.genes.items():
            checks.choice(f"space.{name}", name, known)
            low += _bounds(f"space.{name}.low", gene.low, gene.shared, n)
            high += _bounds(f"space.{name}.high", gene.high, gene.shared, n)
            self._places[name] = slice(len(labels), len(low))
            labels += [name] if gene.shared else [f"{name}.{joint}" for joint in range(n)]
            self._log += [gene.scale == "log"] * (len(low) - len(self._log))
        self.low, self.high = checks.read_only(low), checks.read_only(high)
        self.labels, self.size = tuple(labels), len(labels)
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
        base: Any = self.base
        return dataclasses.replace(base, **members)  # type: ignore[no-any-return]

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

    def controller(self, point: FloatArray, name: str | None = None) -> Controller:
        """Return the controller with the parameters at a point, (size,), under a name."""
        values = self.values(point)
        return self.renamed(name, {key: self._member(key, values) for key in self.space.genes})

    def renamed(self, name: str | None, members: Mapping[str, Any] | None = None) -> Controller:
        """Return the controller that the space was met by, under another name."""
        named = {"name": name} if name is not None and hasattr(self.base, "name") else {}
        return self._replace({**(members or {}), **named})

    def at_bounds(self, point: FloatArray) -> tuple[str, ...]:
        """Return the labels of what lies at a bound, or within a hundredth of the range of it."""
        near = np.minimum(point, 1.0 - point) < 0.01
        return tuple(label for label, here in zip(self.labels, near, strict=True) if here)

    def parameters(self, controller: Controller) -> dict[str, float | FloatArray]:
        """Return what a controller has of the parameters sought, by name; NaN: left to it."""
        given = {name: getattr(controller, name) for name in self.space.genes}
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in given.items()}
        return {name: value if value.ndim else float(value) for name, value in arrays.items()}

    def settings(self, controller: Controller) -> FloatArray:
        """Return what a controller has of the numbers sought, (size,); NaN: left to it."""
        out = np.empty(self.size)
        for name, value in self.parameters(controller).items():
            # Learning rates may be a row for each of Kp, Ki, Kd.
            row = np.mean(value, axis=0) if np.ndim(value) > 1 else value
            rows = np.broadcast_to(row, (self.n,))
            out[self._places[name]] = rows.mean() if self.space.genes[name].shared else rows
        return out

    def nearest(self, controller: Controller) -> FloatArray:
        """Return the nearest point to a controller, (size,); the middle for what is left to it."""
        values = self.settings(controller)
        point = self._coordinates(np.clip(values, self.low, self.high))
        return np.where(np.isnan(values), 0.5, point)

    def point(self, controller: Controller) -> FloatArray:
        """Return the point at which `controller` lies, (size,); refuse one that lies outside."""
        for name, place in self._places.items():
            if not hasattr(controller, name):
                kind = type(controller).__name__
                raise ArgumentError(f"initial.{name}", f"a controller with {name}", f"a {kind}")
            given = checks.per_joint(f"initial.{name}", getattr(controller, name), self.n)
            low, high = self.low[place], self.high[place]
            if self.space.genes[name].shared and (given != given[0]).any():
                raise ArgumentError(f"initial.{name}", "one value for all joints", given)
            if (given < low).any() or (given > high).any():
                raise ArgumentError(f"initial.{name}", f"within {low} and {high}", given)
        return self._coordinates(self.settings(controller))

    def _coordinates(self, values: FloatArray) -> FloatArray:
        scaled = [
            np.where(self._log, np.log(np.where(self._log, x, 1.0)), x)
            for x in (values, self.low, self.high)
        ]
        part = (scaled[0] - scaled[1]) / (scaled[2] - scaled[1])
        return np.asarray(np.clip(part, 0.0, 1.0))


def _bounds(name: str, value: ArrayLike, shared: bool, n: int) -> list[float]:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and shared and n > 1:
        raise ArgumentError(name, "a number (the parameter is shared)", f"shape {array.shape}")
    values: list[float] = checks.per_joint(name, array, n).tolist()
    return values[:1] if shared else values


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
