"""A campaign's description: one experiment, several controllers, what is uncertain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.campaign.quantities import QUANTITIES, require_quantity, varied
from fpid_pin.campaign.scenarios import Scenarios
from fpid_pin.checks import FloatArray
from fpid_pin.control import Controller
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.simulation import Experiment

#: Of a study's table.
FORMAT = 1


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
    title: str = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.instance("scenarios", self.scenarios, Scenarios, "Scenarios")
        if not isinstance(self.controllers, Mapping) or not self.controllers:
            raise ArgumentError("controllers", "at least one, by name", "none")
        for name, controller in self.controllers.items():
            checks.instance(f"controllers.{name}", controller, Controller, "a Controller")
        # Dynamics written out: what is recorded says it, and a replay has the same bits.
        experiment = self.experiment.with_dynamics("compiled")
        self._set(controllers=dict(self.controllers), experiment=experiment)
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

    def to_dict(self) -> dict[str, Any]:
        """Return the table that `from_dict` rebuilds the study from."""
        return {
            "format": FORMAT,
            "title": self.title,
            "experiment": descriptions.to_dict(self.experiment),
            "controllers": {k: descriptions.to_dict(c) for k, c in self.controllers.items()},
            "scenarios": self.scenarios.to_dict(),
        }

    @classmethod
    def from_dict(cls, table: Any, name: str = "campaign") -> Study:
        """Return the study that a table holds, or say in a line why there is none."""
        if not isinstance(table, Mapping) or table.get("format") != FORMAT:
            raise FileFormatError(f"{name}: expected a campaign of format {FORMAT}, got another")
        faults: list[FpidError] = []
        try:
            experiment = descriptions.build(table["experiment"], Experiment, "experiment", faults)
            controllers = {
                key: descriptions.build(value, Controller, f"controller {key}", faults)
                for key, value in table["controllers"].items()
            }
            scenarios = Scenarios.from_table(table["scenarios"], "scenarios", faults)
            if faults:
                raise faults[0]
            return cls(experiment, controllers, scenarios, str(table["title"]))
        except (KeyError, AttributeError, TypeError) as error:
            raise FileFormatError(f"{name}: expected a campaign's table, got {error!r}") from None
        except FpidError as error:
            raise FileFormatError(f"{name}: {error}") from None

    @property
    def text(self) -> str:
        """The table as JSON, every digit of every number."""
        return json.dumps(self.to_dict())
