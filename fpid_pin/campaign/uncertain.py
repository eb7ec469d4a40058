"""What of an experiment can be uncertain: distributions, and an experiment with drawn values."""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Flag, FloatArray, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.disturbances import Cosine
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment, Plant, Sensors
from fpid_pin.text import unit_for

#: Half a cell of the grid that Sobol points lie on: a normal quantile of 0 is -inf.
_EDGE = 2.0**-31


@dataclass(frozen=True, eq=False)
class Distribution(Description, ABC):
    """The distribution of one quantity; its numbers are those of all joints, or (n,), one a joint.

    Parameters
    ----------
    shared
        Whether all joints have the same number; else each has its own, independently.
    """

    _possible: ClassVar[tuple[str, ...]] = ("low", "high")

    shared: Annotated[bool, Flag] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        ends = self.numbers()
        if "low" in ends and not (ends["low"] < ends["high"]).all():
            expected = f"more than low ({ends['low'].tolist()})"
            raise ArgumentError("high", expected, ends["high"].tolist())

    @abstractmethod
    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """Return the values at `u` in [0, 1], (runs, numbers), none beyond [`low`, `high`]."""

    def numbers(self) -> dict[str, FloatArray]:
        """Return by field the numbers that have to be possible values themselves."""
        return {name: np.asarray(getattr(self, name)) for name in self._possible}


@described("uniform")
@dataclass(frozen=True, eq=False, kw_only=True)
class Uniform(Distribution):
    """Equally likely from `low` to `high`."""

    low: Annotated[ArrayLike, PerJoint()]
    high: Annotated[ArrayLike, PerJoint()]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(a + (b - a) * u)


@described("log_uniform")
@dataclass(frozen=True, eq=False, kw_only=True)
class LogUniform(Distribution):
    """Its logarithm is equally likely from that of `low` to that of `high`, both positive."""

    low: Annotated[ArrayLike, PerJoint(above=0.0)]
    high: Annotated[ArrayLike, PerJoint(above=0.0)]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(np.clip(a * (b / a) ** u, a, b))


@described("normal")
@dataclass(frozen=True, eq=False, kw_only=True)
class Normal(Distribution):
    """A normal distribution; where the quantity has limits it is cut there, and what is left is 1.

    Parameters
    ----------
    mean, std
        Of the distribution before it is cut.
    """

    _possible = ("mean",)

    mean: Annotated[ArrayLike, PerJoint()]
    std: Annotated[ArrayLike, PerJoint(above=0.0)]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        # Imported late: scipy is heavy.
        from scipy.special import ndtr, ndtri

        mean, std = np.asarray(self.mean), np.asarray(self.std)
        first, last = ndtr((low - mean) / std), ndtr((high - mean) / std)
        part = first + np.clip(u, _EDGE, 1.0 - _EDGE) * (last - first)
        return np.asarray(np.clip(mean + std * ndtri(part), low, high))


@described("choices")
@dataclass(frozen=True, eq=False, kw_only=True)
class Choices(Distribution):
    """One of several `values`, equally likely; the same list for every joint."""

    _possible = ("values",)

    values: Annotated[ArrayLike, PerJoint()]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        values = np.atleast_1d(np.asarray(self.values))
        place = np.minimum((u * len(values)).astype(np.int64), len(values) - 1)
        return np.asarray(values[place])


@dataclass(frozen=True)
class Quantity:
    """A key of ``[campaign.uncertain]``."""

    unit: str
    single: bool = False  # whether there is one number; else one for each joint, or link
    low: float | None = None  # least value
    above: float | None = None  # what values have to be more than
    whole: bool = False  # whether values are rounded to whole numbers

    def at(self, distribution: Distribution, u: FloatArray) -> FloatArray:
        """Return the values at points of [0, 1], (runs, numbers)."""
        low = next((x for x in (self.low, self.above) if x is not None), -np.inf)
        found = distribution.quantile(u, low, np.inf)
        return np.round(found) if self.whole else found


#: By key. Masses and inertias are factors of the nominal ones, all else takes the nominal's place.
QUANTITIES = {
    "mass": Quantity("1", above=0.0),
    "inertia": Quantity("1", above=0.0),
    "payload": Quantity("kg", single=True, low=0.0),
    "viscous_friction": Quantity("N m s/rad", low=0.0),
    "dry_friction": Quantity("N m", low=0.0),
    "disturbance_amplitude": Quantity("N m"),
    "disturbance_frequency": Quantity("rad/s", low=0.0),
    "disturbance_phase": Quantity("rad"),
    "position_noise": Quantity("rad", low=0.0),
    "velocity_noise": Quantity("rad/s", low=0.0),
    "delay": Quantity("samples", single=True, low=0.0, whole=True),
    "q0": Quantity("rad"),
    "v0": Quantity("rad/s"),
    "reference_amplitude": Quantity("rad"),
    "reference_frequency": Quantity("rad/s", low=0.0),
    "reference_phase": Quantity("rad"),
}


def units_of(labels: Iterable[str], angles: Sequence[str]) -> tuple[str, ...]:
    """Return the units of uncertain numbers by their labels: ``"payload"``, ``"mass.0"``.

    `angles` are the units of the joints' coordinates, (n,); those of an oscillation are no joint's.
    """

    def unit(label: str) -> str:
        key, _, joint = label.partition(".")
        of = QUANTITIES[key].unit
        its = angles[int(joint) : int(joint) + 1] if joint else angles
        return of if key.endswith(("frequency", "phase")) else unit_for(of, its)

    return tuple(map(unit, labels))


def require_values(path: str, distribution: Distribution) -> Distribution:
    """Refuse a distribution with values that its quantity cannot have: ``uncertain.mass``."""
    quantity = QUANTITIES[checks.choice(path, path.partition("uncertain.")[2], QUANTITIES)]
    for name, numbers in distribution.numbers().items():
        checks.floats(f"{path}.{name}", numbers, low=quantity.low, above=quantity.above)
        if quantity.whole and name == "values" and (numbers != np.round(numbers)).any():
            raise ArgumentError(f"{path}.{name}", "whole numbers", numbers.tolist())
        if (quantity.single or distribution.shared) and name != "values" and numbers.ndim:
            raise ArgumentError(f"{path}.{name}", "one number", f"shape {numbers.shape}")
    if quantity.single and distribution.shared:
        raise ArgumentError(f"{path}.shared", "false, as there is one number", "true")
    return distribution


def labels_of(experiment: Experiment, key: str, distribution: Distribution) -> list[str]:
    """Return the labels of a quantity's numbers; refuse one that the experiment does not have."""
    path, (part, _, name) = f"uncertain.{key}", key.partition("_")
    if part == "reference":
        reference: Any = experiment.reference
        fields = dataclasses.fields(reference) if dataclasses.is_dataclass(reference) else ()
        if name not in {field.name for field in fields}:
            kind = getattr(type(reference), "_kind", type(reference).__name__)
            raise ArgumentError(path, f"a reference with {name} (a sinusoid)", kind)
    elif part == "disturbance":
        disturbance = (experiment.plant or Plant()).disturbance
        if not isinstance(disturbance, Cosine):
            kind = getattr(type(disturbance), "_kind", "none")
            raise ArgumentError(path, "one [[disturbance]] of kind cosine", kind)
    if QUANTITIES[key].single or distribution.shared:
        return [key]
    for name, numbers in distribution.numbers().items():
        if name != "values":
            checks.per_joint(f"{path}.{name}", numbers, experiment.arm.n)
    return [f"{key}.{j}" for j in range(experiment.arm.n)]


def varied(nominal: Experiment, values: Mapping[str, FloatArray], seed: int) -> Experiment:
    """Return an experiment with other true values; what the controller believes in stays.

    `values` are by the keys of `QUANTITIES`, (1,) or (n,); `seed` is that of its sensors' noise.
    """
    value: dict[str, Any] = {k: v if len(v) > 1 else v[0] for k, v in values.items()}

    def some(*keys: str, prefix: str = "") -> dict[str, Any]:
        return {key: value[prefix + key] for key in keys if prefix + key in value}

    cosine, plant = ("amplitude", "frequency", "phase"), nominal.plant or Plant()
    changed: dict[str, Any] = some("viscous_friction", "dry_friction")
    scaled = some("mass", "inertia")
    carried: list[dict[str, Any]] = [{"scaled_links": scaled}] if scaled else []
    if "payload" in value:
        carried.append({"payload": {"mass": float(value["payload"])}})
    if carried:
        arm = plant.resolve(nominal.arm).arm
        changed |= {"arm": arm.with_changes(*carried), "payload": None}
    pushed = some(*cosine, prefix="disturbance_")
    if pushed:
        disturbance: Any = plant.disturbance
        changed["disturbance"] = dataclasses.replace(disturbance, **pushed)
    parts = some("q0", "v0") | {"plant": dataclasses.replace(plant, **changed), "seed": seed}
    sensed = some("position_noise", "velocity_noise", "delay")
    if sensed:
        sensed |= {key: int(number) for key, number in some("delay").items()}
        parts["sensors"] = dataclasses.replace(nominal.sensors or Sensors(), **sensed)
    moved = some(*cosine, prefix="reference_")
    if moved:
        reference: Any = nominal.reference
        parts["reference"] = dataclasses.replace(reference, **moved)
    return dataclasses.replace(nominal, **parts)
