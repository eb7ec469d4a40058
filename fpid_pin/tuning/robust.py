"""Costs over several plants and payloads at once."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray, OneOf
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, Metrics, QuadraticCost, RowCost
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError, FpidWarning, WorkersDied
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment, Plant, evaluate

REDUCTIONS = ("mean", "worst")


@described("robust_cost")
@dataclass(frozen=True, eq=False)
class RobustCost(Cost):
    """One number for a controller that has been through several experiments.

    Parameters
    ----------
    cost
        Of each run.
    reduce
        ``"mean"`` or ``"worst"`` over the experiments; a run that diverges makes both +inf.
    """

    _path = "robust_cost"

    cost: Cost = field(default_factory=QuadraticCost)
    reduce: Annotated[str, OneOf(*REDUCTIONS)] = "worst"

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.cost, RobustCost):
            raise ArgumentError("robust_cost.cost", "the cost of one run", "a RobustCost")

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`: the cost of one run alone."""
        return self.cost.of(metrics)

    def streamed(self) -> RowCost | None:
        """See `Cost.streamed`."""
        return self.cost.streamed()


def over_scenarios(cost: Cost, table: FloatArray) -> FloatArray:
    """Reduce costs of each scenario, (scenarios, candidates), to (candidates,).

    A cost that says nothing about it is averaged. NaN counts as +inf: nothing may win by it.
    """
    sound = np.where(np.isnan(table), np.inf, table)
    if isinstance(cost, RobustCost) and cost.reduce == "worst":
        return np.asarray(sound.max(axis=0))
    # Row after row, so that a candidate's mean does not depend on how many candidates there are.
    return np.asarray(np.add.accumulate(sound)[-1] / len(sound))


class Objective:
    """Costs of controllers over all experiments, each of which every controller goes through.

    Workers that die twice over the same runs are left alone from then on, with a warning; the work
    goes on in this process, and the results are the same.
    """

    def __init__(
        self, experiments: Sequence[Experiment], costs: Sequence[Cost], executor: Executor | None
    ) -> None:
        self.experiments, self.costs, self._executor = list(experiments), list(costs), executor

    def __call__(
        self, controllers: Sequence[Controller], progress: ProgressCallback | None = None
    ) -> FloatArray:
        """Return costs, (controllers, costs); +inf where a run diverged."""
        count = len(controllers)
        # Experiment by experiment: what neighbouring runs are given from outside is sampled once.
        experiments = [e for e in self.experiments for _ in range(count)]
        runs = list(controllers) * len(self.experiments)
        try:
            table = evaluate(
                experiments, runs, self.costs, executor=self._executor, progress=progress
            )
        except WorkersDied as error:
            line = f"{error}; going on in this process, with the same results"
            warnings.warn(line, FpidWarning, stacklevel=2)
            self._executor = None
            table = evaluate(experiments, runs, self.costs, progress=progress)
        cube = table.reshape(len(self.experiments), count, len(self.costs))
        columns = [over_scenarios(cost, cube[:, :, k]) for k, cost in enumerate(self.costs)]
        return np.stack(columns, axis=1)


def scenarios(
    experiment: Experiment,
    *,
    plants: Iterable[Plant | None] = (),
    payloads: Iterable[float] = (),
) -> list[Experiment]:
    """Return variations of one experiment: every plant with every payload.

    Parameters
    ----------
    experiment
        The controller's belief, its reference and start stay as they are here.
    plants
        True robots; none given: the experiment's own.
    payloads
        Point masses at the arm's tool [kg] that the controller does not know of; none given: 0.

    Raises
    ------
    ArgumentError
        A negative payload, or a plant that does not fit the arm.
    """
    masses = [checks.number("payload", mass, low=0.0) for mass in payloads] or [0.0]
    varied = []
    for plant in list(plants) or [experiment.plant]:
        for mass in masses:
            true = plant
            if mass > 0.0:
                base = plant or Plant()
                arm = experiment.arm if base.arm is None else base.arm
                true = dataclasses.replace(base, arm=arm.with_payload(mass))
            varied.append(dataclasses.replace(experiment, plant=true))
    return varied
