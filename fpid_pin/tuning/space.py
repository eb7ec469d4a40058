"""What a search may change: parameters of a controller by name, with bounds."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Annotated, Any

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

    def bind(self, controller: Controller, n: int) -> "BoundSpace":
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

    Their names are ``kp.0`` for joint 0 (first), ``kp`` for a shared one; bounds are (size,).
    """

    def __init__(self, space: Space, controller: Controller, n: int) -> None:
        self.space, self.base, self.n = space, controller, n
        self.genes = space.genes
        known = _numeric_parameters(controller)
        self._places: dict[str, slice] = {}
        ends: dict[str, list[float]] = {"low": [], "high": []}
        labels: list[str] = []
        log: list[bool] = []
        for name, gene in self.genes.items():
            checks.choice(f"space.{name}", name, list(known))
            if known[name] and not gene.shared:
                expected = '"shared" behind its bounds, as all joints have one value'
                raise ArgumentError(f"space.{name}", expected, "none")
            several = [name] if gene.shared else [f"{name}.{joint}" for joint in range(n)]
            self._places[name] = slice(len(labels), len(labels) + len(several))
            labels += several
            log += [gene.scale == "log"] * len(several)
            for end, values in ends.items():
                path, given = f"space.{name}.{end}", getattr(gene, end)
                if gene.shared:
                    values.append(checks.number(path, given))
                else:
                    values += checks.per_joint(path, given, n).tolist()
                try:
                    self._replace({name: self._member(name, np.array(values))})
                except ArgumentError as error:
                    raise ArgumentError(path, error.expected, error.got) from None
        self.low, self.high = checks.read_only(ends["low"]), checks.read_only(ends["high"])
        self.labels, self.size, self._log = tuple(labels), len(labels), log

    def _member(self, name: str, values: FloatArray) -> float | FloatArray:
        part = values[self._places[name]]
        return float(part[0]) if self.genes[name].shared else checks.read_only(part)

    def _replace(self, members: Mapping[str, Any]) -> Controller:
        base: Any = self.base
        return dataclasses.replace(base, **members)  # type: ignore[no-any-return]

    def values(self, points: FloatArray) -> FloatArray:
        """Map points of the unit cube, (..., size), to parameter values of the same shape."""
        x = np.asarray(points, dtype=np.float64)
        values = self.low + x * (self.high - self.low)
        for k in np.flatnonzero(self._log):
            low, range_ = float(self.low[k]), math.log(self.high[k] / self.low[k])
            # Scalar exp on purpose: numpy's vector exp may round a value differently according to
            # where in an array it stands, and a candidate must not depend on its company.
            each = [low * math.exp(part * range_) for part in np.ravel(x[..., k]).tolist()]
            values[..., k] = np.reshape(each, x.shape[:-1])
        return np.where(x >= 1.0, self.high, np.clip(values, self.low, self.high))

    def controller(self, values: FloatArray | None, name: str | None = None) -> Controller:
        """Return the controller with these values, (size,), or None: its own, under a name."""
        members = {} if values is None else {key: self._member(key, values) for key in self.genes}
        named = {"name": name} if name is not None and hasattr(self.base, "name") else {}
        return self._replace({**members, **named})

    def parameters(self, controller: Controller) -> dict[str, float | FloatArray]:
        """Return what a controller has of the parameters sought, by name; NaN: left to it."""
        given = {name: getattr(controller, name) for name in self.genes}
        arrays = {name: np.asarray(value, dtype=np.float64) for name, value in given.items()}
        return {name: value if value.ndim else float(value) for name, value in arrays.items()}

    def numbers(self, controller: Controller) -> FloatArray:
        """Return what a controller has of the numbers sought, (size,); NaN: left to it."""
        out = np.empty(self.size)
        for name, value in self.parameters(controller).items():
            # Learning rates may be a row for each of Kp, Ki, Kd.
            row = np.mean(value, axis=0) if np.ndim(value) > 1 else value
            rows = np.broadcast_to(row, (self.n,))
            out[self._places[name]] = rows.mean() if self.genes[name].shared else rows
        return out

    def nearest(self, controller: Controller) -> FloatArray:
        """Return the nearest point to a controller, (size,); the middle for what is left to it."""
        numbers = self.numbers(controller)
        point = self._coordinates(np.clip(numbers, self.low, self.high))
        return np.where(np.isnan(numbers), 0.5, point)

    def point(self, controller: Controller) -> FloatArray:
        """Return the point at which `controller` lies, (size,); refuse one that lies outside."""
        for name, place in self._places.items():
            if not hasattr(controller, name):
                kind = type(controller).__name__
                raise ArgumentError(f"initial.{name}", f"a controller with {name}", f"a {kind}")
            given = checks.per_joint(f"initial.{name}", getattr(controller, name), self.n)
            low, high = self.low[place], self.high[place]
            if self.genes[name].shared and (given != given[0]).any():
                raise ArgumentError(f"initial.{name}", "one value for all joints", given)
            if (given < low).any() or (given > high).any():
                raise ArgumentError(f"initial.{name}", f"within {low} and {high}", given)
        return self._coordinates(self.numbers(controller))

    def _coordinates(self, numbers: FloatArray) -> FloatArray:
        x, low, high = (
            np.where(self._log, np.log(np.where(self._log, values, 1.0)), values)
            for values in (numbers, self.low, self.high)
        )
        return np.asarray(np.clip((x - low) / (high - low), 0.0, 1.0))


def _numeric_parameters(controller: Controller) -> dict[str, bool]:
    """Return by name which arguments hold numbers, and whether all joints have one of them."""
    if not dataclasses.is_dataclass(controller):
        raise ArgumentError("controller", "a dataclass", type(controller).__name__)
    found = {}
    keys = descriptions.keys(type(controller))
    # The law's own before the options that all laws have.
    for field in sorted(dataclasses.fields(controller), key=lambda field: field.kw_only is True):
        key, value = keys.get(field.name), getattr(controller, field.name)
        if key is None or (value is None and key.family is not None):
            continue
        # None: a number that is left to the controller.
        if value is None or np.asarray(value).dtype.kind in "iuf":
            found[field.name] = bool(key.checks) and not key.is_per_joint
    return found
