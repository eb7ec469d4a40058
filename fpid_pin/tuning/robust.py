"""A cost over several plants and payloads at once."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Annotated

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray, OneOf
from fpid_pin.costs import Cost, Metrics, QuadraticCost, RowCost
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment, Plant

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
        worst: FloatArray = np.maximum.reduce(sound, axis=0)
        return worst
    # Row after row, so that a candidate's mean does not depend on how many candidates there are.
    total = sound[0].copy()
    for row in sound[1:]:
        total += row
    return np.asarray(total / len(sound))


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
    chosen = list(plants) or [experiment.plant]
    varied = []
    for plant in chosen:
        for mass in masses:
            true = plant
            if mass > 0.0:
                base = Plant() if plant is None else plant
                arm = experiment.arm if base.arm is None else base.arm
                true = dataclasses.replace(base, arm=arm.with_payload(mass))
            varied.append(dataclasses.replace(experiment, plant=true))
    return varied
