"""A campaign's description: one experiment, several controllers, what is uncertain, which plants.

Run k's plants depend on the seed and on k, on nothing else.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import descriptions
from fpid_pin.campaign.data import Success
from fpid_pin.campaign.uncertain import QUANTITIES, Distribution, labels_of, require_values, varied
from fpid_pin.checks import Array, Check, FloatArray, OneOf, Plain, Text, Whole
from fpid_pin.control import Controller
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.experiment import DYNAMICS

#: Points that are made at once, from run 0 on: a hypercube of so many runs, whatever is asked for.
BLOCK = 256


@described("scenarios")
@dataclass(frozen=True, eq=False)
class Scenarios(Description):
    """What is uncertain, and how it is sampled.

    Parameters
    ----------
    uncertain
        Distributions by quantity: masses and inertias of the links, payload, friction, ... (see
        `uncertain.QUANTITIES`). One of joints is drawn for each by itself, or ``shared``.
    sampling
        ``"sobol"``: one scrambled Sobol sequence (Owen, 1998); ``"latin_hypercube"``: one of every
        256 runs. Both by ``scipy.stats.qmc``.
    seed
        What the samples derive from, noise included.
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

    uncertain: Annotated[Mapping[str, Distribution], Check(require_values)]
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

    def noise_seed(self, run: int) -> int:
        """Return the seed of a run's noise."""
        # Points are compared, and found again under another number.
        index = run if self.points is None else 0
        return int(np.random.SeedSequence([self.seed, index]).generate_state(1, np.uint64)[0])


@lru_cache(4)
def _block(sampling: str, seed: int, size: int, k: int) -> FloatArray:
    """Return the points of block `k`, (BLOCK, size); a few are kept, as chunks come in order."""
    # Imported late: scipy is heavy.
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
        """Labels of the numbers of each uncertain quantity."""
        uncertain = self.scenarios.uncertain.items()
        return {
            key: labels_of(self.experiment, key, distribution) for key, distribution in uncertain
        }

    @property
    def parameters(self) -> tuple[str, ...]:
        """Labels of a sample's numbers: ``"payload"``, ``"viscous_friction.0"``."""
        return tuple(label for labels in self._labels.values() for label in labels)

    @cached_property
    def laws(self) -> tuple[Controller, ...]:
        """The controllers as they are on the arm: a suggestion of gains takes a second."""
        arm, step = self.experiment.arm, self.experiment.step
        return tuple(law.on(arm, step=step) for law in self.controllers.values())

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the controllers, in order."""
        return tuple(self.controllers)

    def _split(self, numbers: FloatArray) -> dict[str, FloatArray]:
        """Return the columns of each quantity, of numbers (..., parameters)."""
        ends = np.cumsum([len(labels) for labels in self._labels.values()])[:-1]
        return dict(zip(self._labels, np.split(numbers, ends, axis=-1), strict=True))

    def samples(self, first: int, last: int) -> FloatArray:
        """Return the values of runs `first` to `last` - 1, (runs, parameters)."""
        points = self.scenarios.cube(first, last, len(self.parameters))
        uncertain = self.scenarios.uncertain
        parts = [QUANTITIES[key].at(uncertain[key], u) for key, u in self._split(points).items()]
        return np.concatenate(parts, axis=1)

    def experiment_of(self, run: int, sample: FloatArray) -> Experiment:
        """Return the experiment of a run from its sample, (parameters,)."""
        return varied(self.experiment, self._split(sample), self.scenarios.noise_seed(run))

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
        Plants.
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
