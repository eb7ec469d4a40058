"""A campaign's description: one experiment, several controllers, what is uncertain, which plants.

Run k's plants depend on the seed and on k, on nothing else.
"""

import dataclasses
import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin.campaign.data import Success
from fpid_pin.checks import Array, Check, Flag, FloatArray, OneOf, PerJoint, Plain, Text, Whole
from fpid_pin.control import Controller
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment, Plant, Sensors
from fpid_pin.simulation.experiment import DYNAMICS

#: Points that are made at once, from run 0 on: a hypercube of so many runs, whatever is asked for.
BLOCK = 256
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
    """Uniform from `low` to `high`."""

    low: Annotated[ArrayLike, PerJoint()]
    high: Annotated[ArrayLike, PerJoint()]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(a + (b - a) * u)


@described("log_uniform")
@dataclass(frozen=True, eq=False, kw_only=True)
class LogUniform(Distribution):
    """Uniform in the logarithm, from `low` to `high`, both positive."""

    low: Annotated[ArrayLike, PerJoint(above=0.0)]
    high: Annotated[ArrayLike, PerJoint(above=0.0)]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(np.clip(a * (b / a) ** u, a, b))


@described("normal")
@dataclass(frozen=True, eq=False, kw_only=True)
class Normal(Distribution):
    """A normal distribution, cut off where the quantity has limits.

    Parameters
    ----------
    mean, std
        Mean and standard deviation before it is cut off.
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
    """One of `values`, all equally likely; the same list for every joint."""

    _possible = ("values",)

    values: Annotated[ArrayLike, PerJoint()]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        values = np.atleast_1d(np.asarray(self.values))
        place = np.minimum((u * len(values)).astype(np.int64), len(values) - 1)
        return np.asarray(values[place])


@dataclass(frozen=True)
class Quantity:
    """A key of ``[campaign.uncertain]``: the field of that name of its part, or ``part_name``."""

    unit: str
    part: str  # of the experiment that has it
    single: bool = False  # whether there is one number; else one for each joint, or link
    low: float = -np.inf  # least value
    above: bool = False  # whether values have to be more than that
    whole: bool = False  # whether values are rounded to whole numbers


#: By key. Masses and inertias are factors of the nominal ones, all else takes the nominal's place.
QUANTITIES = {
    "mass": Quantity("1", "links", low=0.0, above=True),
    "inertia": Quantity("1", "links", low=0.0, above=True),
    "payload": Quantity("kg", "tool", single=True, low=0.0),
    "viscous_friction": Quantity("N m s/rad", "plant", low=0.0),
    "dry_friction": Quantity("N m", "plant", low=0.0),
    "disturbance_amplitude": Quantity("N m", "disturbance"),
    "disturbance_frequency": Quantity("rad/s", "disturbance", low=0.0),
    "disturbance_phase": Quantity("rad", "disturbance"),
    "position_noise": Quantity("rad", "sensors", low=0.0),
    "velocity_noise": Quantity("rad/s", "sensors", low=0.0),
    "delay": Quantity("samples", "sensors", single=True, low=0.0, whole=True),
    "q0": Quantity("rad", "start"),
    "v0": Quantity("rad/s", "start"),
    "reference_amplitude": Quantity("rad", "reference"),
    "reference_frequency": Quantity("rad/s", "reference", low=0.0),
    "reference_phase": Quantity("rad", "reference"),
}


def _require_values(path: str, distribution: Distribution) -> Distribution:
    """Refuse a distribution with values that its quantity cannot have: ``uncertain.mass``."""
    quantity = QUANTITIES[checks.choice(path, path.partition("uncertain.")[2], QUANTITIES)]
    for name, numbers in distribution.numbers().items():
        bounds: dict[str, Any] = {"above" if quantity.above else "low": quantity.low}
        checks.floats(f"{path}.{name}", numbers, **bounds)
        if quantity.whole and name == "values" and (numbers != np.round(numbers)).any():
            raise ArgumentError(f"{path}.{name}", "whole numbers", numbers.tolist())
        if (quantity.single or distribution.shared) and name != "values" and numbers.ndim:
            raise ArgumentError(f"{path}.{name}", "one number", f"shape {numbers.shape}")
    return distribution


@described("scenarios")
@dataclass(frozen=True, eq=False)
class Scenarios(Description):
    """What is uncertain, and how it is sampled.

    Parameters
    ----------
    uncertain
        Distributions by quantity: masses and inertias of the links, payload, friction, ... (see
        `study.QUANTITIES`). One of joints is drawn for each by itself, or ``shared``.
    sampling
        ``"sobol"``: one scrambled Sobol sequence (Owen, 1998); ``"latin_hypercube"``: one of every
        256 runs. Both by ``scipy.stats.qmc``.
    seed
        Seed of the samples and of the noise.
    points
        Runs' points of the unit cube, (runs, numbers), in place of samples: run k has the
        quantiles at ``points[k]``; all have the same noise.

    Notes
    -----
    Run k has the same sample however many runs there are, and whoever computes it; all controllers
    meet it. A quantity more or less is another cube, and other samples.

    Raises
    ------
    ArgumentError
        An unknown quantity, an impossible value (a negative mass), naming the key.
    """

    uncertain: Annotated[Mapping[str, Distribution], Check(_require_values)]
    sampling: Annotated[str, OneOf("sobol", "latin_hypercube")] = "sobol"
    seed: Annotated[int, Whole(low=0)] = 0
    points: Annotated[ArrayLike | None, Array(low=0.0, high=1.0, shape=(None, None))] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.uncertain:
            raise ArgumentError("uncertain", "at least one quantity with its distribution", "none")

    def cube(self, first: int, last: int, size: int) -> FloatArray:
        """Return the points of runs `first` to `last` - 1 in the unit cube, (runs, size)."""
        if self.points is not None:
            return np.asarray(self.points)[first:last]
        blocks = range(first // BLOCK, (last - 1) // BLOCK + 1)
        points = np.concatenate([_block(self.sampling, self.seed, size, k) for k in blocks])
        skipped = blocks.start * BLOCK
        return np.asarray(points[first - skipped : last - skipped])


@lru_cache(4)
def _block(sampling: str, seed: int, size: int, k: int) -> FloatArray:
    """Return the points of block `k`, (BLOCK, size); a few are kept, as chunks come in order."""
    from scipy.stats import qmc

    if sampling == "sobol":
        sobol = qmc.Sobol(size, rng=np.random.default_rng(seed))
        if k:
            sobol.fast_forward(k * BLOCK)
        return np.asarray(sobol.random(BLOCK))
    rng = np.random.default_rng(np.random.SeedSequence([seed, k]))
    return np.asarray(qmc.LatinHypercube(size, rng=rng).random(BLOCK))


@described("study")
@dataclass(frozen=True, eq=False)
class Study(Description):
    """What a campaign simulates: every run's plant under every controller.

    Parameters
    ----------
    experiment
        The nominal one. Where it does not say its dynamics, they are compiled.
    controllers
        By name.
    scenarios
        What of the experiment is uncertain.
    title
        For reports.
    success
        When a run counts as a success: for reports, too.

    Raises
    ------
    ArgumentError
        No controller; a quantity that the experiment does not have; numbers for another number of
        joints.
    """

    experiment: Experiment
    controllers: Mapping[str, Controller]
    scenarios: Scenarios
    title: Annotated[str, Text] = ""
    success: Success = field(default_factory=Success)

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.controllers:
            raise ArgumentError("controllers", "at least one, by name", "none")
        # Dynamics written out: what is recorded says it, and a replay has the same bits.
        self._set(experiment=self.experiment.with_dynamics("compiled"))
        points, size = np.asarray(self.scenarios.points), len(self.parameters)
        if points.ndim and points.shape[1] != size:
            raise ArgumentError("points", f"shape (runs, {size})", f"shape {points.shape}")

    @cached_property
    def _labels(self) -> dict[str, list[str]]:
        """Labels of the numbers of each uncertain quantity, which the experiment must have."""
        found = {}
        plant, n = self.experiment.plant or Plant(), self.experiment.arm.n
        for key, distribution in self.scenarios.uncertain.items():
            quantity, path = QUANTITIES[key], f"uncertain.{key}"
            part, name = quantity.part, key.removeprefix(f"{quantity.part}_")
            if part in ("reference", "disturbance"):
                thing = self.experiment.reference if part == "reference" else plant.disturbance
                if name not in getattr(thing, "__dataclass_fields__", {}):
                    kind = getattr(type(thing), "_kind", type(thing).__name__)
                    like = {"reference": "a sinusoid", "disturbance": "one of kind cosine"}[part]
                    expected = f"a {part} with {name} ({like})"
                    raise ArgumentError(path, expected, "none" if thing is None else kind)
            single = quantity.single or distribution.shared
            found[key] = [key] if single else [f"{key}.{joint}" for joint in range(n)]
            for end, numbers in distribution.numbers().items():
                if end != "values" and not single:
                    checks.per_joint(f"{path}.{end}", numbers, n)
        return found

    @property
    def parameters(self) -> tuple[str, ...]:
        """Labels of a sample's numbers: ``"payload"``, ``"viscous_friction.0"``."""
        return tuple(label for labels in self._labels.values() for label in labels)

    @cached_property
    def laws(self) -> tuple[Controller, ...]:
        """The controllers as they are on the arm: a suggestion of gains takes a second."""
        arm, step = self.experiment.arm, self.experiment.step
        return tuple(law.on(arm, step=step) for law in self.controllers.values())

    def _split(self, numbers: FloatArray) -> dict[str, FloatArray]:
        """Return the columns of each quantity, of numbers (..., parameters)."""
        ends = np.cumsum([len(labels) for labels in self._labels.values()])[:-1]
        return dict(zip(self._labels, np.split(numbers, ends, axis=-1), strict=True))

    def samples(self, first: int, last: int) -> FloatArray:
        """Return the values of runs `first` to `last` - 1, (runs, parameters)."""
        parts = []
        points = self.scenarios.cube(first, last, len(self.parameters))
        for key, u in self._split(points).items():
            quantity = QUANTITIES[key]
            found = self.scenarios.uncertain[key].quantile(u, quantity.low, np.inf)
            parts.append(np.round(found) if quantity.whole else found)
        return np.concatenate(parts, axis=1)

    def experiment_of(self, run: int, sample: FloatArray) -> Experiment:
        """Return the experiment of a run with the true values of its sample, (parameters,).

        What the controller believes in stays.
        """
        of: dict[str, dict[str, Any]] = {q.part: {} for q in QUANTITIES.values()}
        for key, values in self._split(sample).items():
            part, whole = QUANTITIES[key].part, QUANTITIES[key].whole
            value = values if len(values) > 1 else values[0]
            of[part][key.removeprefix(f"{part}_")] = int(value) if whole else value
        nominal: Any = self.experiment
        plant: Any = nominal.plant or Plant()
        carried = [{"scaled_links": of["links"]}] if of["links"] else []
        carried += [{"payload": {"mass": mass}} for mass in of["tool"].values()]
        if carried:
            arm = plant.resolve(nominal.arm).arm.with_changes(*carried)
            of["plant"] |= {"arm": arm, "payload": None}
        if of["disturbance"]:
            pushed = dataclasses.replace(plant.disturbance, **of["disturbance"])
            of["plant"]["disturbance"] = pushed
        changed = {"plant": dataclasses.replace(plant, **of["plant"]), **of["start"]}
        given = {"sensors": nominal.sensors or Sensors(), "reference": nominal.reference}
        for part, thing in given.items():
            if of[part]:
                changed[part] = dataclasses.replace(thing, **of[part])
        # Of its noise. Points are compared, and found again under another number.
        drawn = [self.scenarios.seed, run if self.scenarios.points is None else 0]
        seed = int(np.random.SeedSequence(drawn).generate_state(1, np.uint64)[0])
        return dataclasses.replace(nominal, **changed, seed=seed)  # type: ignore[no-any-return]

    @property
    def text(self) -> str:
        """The table as JSON, every digit of every number."""
        return json.dumps(descriptions.to_dict(self))


@dataclass(frozen=True, eq=False, kw_only=True)
class CampaignTable(Scenarios):
    """The table ``[campaign]`` of a configuration: `Scenarios`, and of what.

    Parameters
    ----------
    runs
        Number of plants.
    dynamics
        ``"compiled"``, or ``"pinocchio"``: slower, the same within rounding.
    controllers
        Some of the ``[[controller]]``; default: all.
    success
        When a run counts as a success: ``error``, ``peak_torque``, ``at_limits``.
    """

    runs: Annotated[int, Whole(low=1)] = 1000
    dynamics: Annotated[str, OneOf(*DYNAMICS)] = "compiled"
    controllers: Annotated[Sequence[str] | None, Plain(list, "a list of names")] = None
    success: Success = field(default_factory=Success)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.controllers is not None and not self.controllers:
            raise ArgumentError("controllers", "a list of names", "[]")
