"""A campaign's description: one experiment, several controllers, what is uncertain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np

from fpid_pin import descriptions
from fpid_pin.campaign.quantities import QUANTITIES, require_quantity, varied
from fpid_pin.campaign.scenarios import Scenarios
from fpid_pin.checks import FloatArray, Text
from fpid_pin.control import Controller
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment


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
    def _counts(self) -> dict[str, int]:
        """Return how many numbers each uncertain quantity has."""
        spreads = self.scenarios.uncertain.items()
        return {key: require_quantity(self.experiment, key, spread) for key, spread in spreads}

    @cached_property
    def parameters(self) -> tuple[str, ...]:
        """Labels of a sample's numbers: ``"payload"``, ``"viscous_friction.0"``."""
        alone = {key: QUANTITIES[key].single or spread.shared
                 for key, spread in self.scenarios.uncertain.items()}  # fmt: skip
        return tuple(
            key if alone[key] else f"{key}.{j}"
            for key, count in self._counts.items()
            for j in range(count)
        )

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
        ends = np.cumsum(list(self._counts.values()))[:-1]
        return dict(zip(self._counts, np.split(numbers, ends, axis=-1), strict=True))

    def samples(self, first: int, last: int) -> FloatArray:
        """Return the values of runs `first` to `last` - 1, (runs, parameters)."""
        points = self.scenarios.cube(first, last, len(self.parameters))
        spreads = self.scenarios.uncertain
        parts = [QUANTITIES[key].at(spreads[key], u) for key, u in self._split(points).items()]
        return np.concatenate(parts, axis=1)

    def experiment_of(self, run: int, sample: FloatArray) -> Experiment:
        """Return the experiment of a run from its sample, (parameters,)."""
        return varied(self.experiment, self._split(sample), self.scenarios.noise_seed(run))

    @property
    def text(self) -> str:
        """The table as JSON, every digit of every number."""
        return json.dumps(descriptions.to_dict(self))
