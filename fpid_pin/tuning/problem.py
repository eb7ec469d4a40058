"""What a search makes small: costs of candidates, over several plants and payloads at once."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, Any

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.checks import FloatArray, OneOf
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, MetricCost, Metrics, QuadraticCost, RowCost, TrackingCost
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError, FpidWarning, WorkersDied
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment, Plant, evaluate
from fpid_pin.simulation.experiment import default_cost
from fpid_pin.simulation.workers import executor_of
from fpid_pin.tuning.space import Space

REDUCTIONS = ("mean", "worst")
#: Of a cost's two terms, the most that one may be at the start without a warning.
MOST_SHARE = 0.9


@described("robust_cost")
@dataclass(frozen=True, eq=False)
class RobustCost(Cost):
    """One number for a controller that has been through several experiments.

    Parameters
    ----------
    cost
        Of each run; None: what `tune` takes by default.
    reduce
        ``"mean"`` or ``"worst"`` over the experiments; a run that diverges makes both +inf.
    """

    _path = "robust_cost"

    cost: Cost | None = None
    reduce: Annotated[str, OneOf(*REDUCTIONS)] = "worst"

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.cost, RobustCost):
            raise ArgumentError("robust_cost.cost", "the cost of one run", "a RobustCost")

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`: the cost of one run alone."""
        return self._each.of(metrics)

    def streamed(self) -> RowCost | None:
        """See `Cost.streamed`."""
        return self._each.streamed()

    @property
    def _each(self) -> Cost:
        if self.cost is None:
            raise ArgumentError("robust_cost.cost", "a cost, outside of tune", "none")
        return self.cost


def over_scenarios(cost: Cost, table: FloatArray) -> FloatArray:
    """Reduce costs of each scenario, (scenarios, candidates), to (candidates,).

    A cost that says nothing about it is averaged. NaN counts as +inf: nothing may win by it.
    """
    sound = np.where(np.isnan(table), np.inf, table)
    if isinstance(cost, RobustCost) and cost.reduce == "worst":
        return np.asarray(sound.max(axis=0))
    # Row after row, so that a candidate's mean does not depend on how many candidates there are.
    return np.asarray(np.add.accumulate(sound)[-1] / len(sound))


class Problem:
    """What is made small, and what may be changed for it: checked, and the space on its law.

    Attributes
    ----------
    experiments
        All that every candidate goes through; where they do not say their dynamics, compiled.
    space
        On the controller. A law that depends on the arm (`SuggestedFpid`) is first made what it is
        there, unless the space has parameters of its own, so that a candidate costs no new search
        for gains.
    """

    def __init__(
        self,
        experiment: Experiment | Sequence[Experiment],
        controller: Controller,
        space: Space,
        cost: Cost | Sequence[Cost] | None,
        *,
        several: bool = False,
    ) -> None:
        experiments = checks.several("experiment", experiment, Experiment, "an Experiment")
        if not experiments:
            raise ArgumentError("experiment", "at least one", "none")
        sizes = sorted({each.arm.n for each in experiments})
        if len(sizes) > 1:
            raise ArgumentError("experiment", "arms with one number of joints", sizes)
        checks.instance("controller", controller, Controller, "a Controller")
        checks.instance("space", space, Space, "a Space")
        if isinstance(cost, Sequence) and not several:
            raise ArgumentError("cost", "one cost (several: use pareto)", f"{len(cost)}")
        if several and (not isinstance(cost, Sequence) or len(cost) < 2):
            raise ArgumentError("costs", "at least two costs (one: use tune)", "one")
        self._given = list(cost) if isinstance(cost, Sequence) else [cost]
        for k, one in enumerate(self._given):
            if one is not None or several:
                checks.instance(f"costs.{k}" if several else "cost", one, Cost, "a Cost")
        self.experiments = [each.with_dynamics("compiled") for each in experiments]
        self.space = space.bind(resolved(controller, self.experiments[0], space), sizes[0])
        self._executor: Executor | None = None

    @cached_property
    def costs(self) -> list[Cost]:
        """What is made small, with a default for what was left open: see `tune`."""
        found: list[Cost] = []
        for cost in self._given:
            if cost is None and len(self.experiments) > 1:
                cost = RobustCost()
            if cost is None:
                cost = self._default()
            elif isinstance(cost, RobustCost) and cost.cost is None:
                cost = dataclasses.replace(cost, cost=self._default())
            found.append(cost)
        return found

    def _default(self) -> Cost:
        """Return the default cost: where that is tracking, at no more variation than the start."""
        cost = default_cost(each.arm for each in self.experiments)
        if isinstance(cost, QuadraticCost):
            return cost
        variation = evaluate(self.experiments, self.space.base, MetricCost("total_variation"))
        finite = variation[np.isfinite(variation) & (variation > 0.0)]
        return TrackingCost(float(finite.max())) if finite.size else cost

    def warn_of_one_sided(self) -> None:
        """Warn where error or energy is nearly all of (33) at the start: it alone is made small."""
        for cost in self.costs:
            each = cost.cost if isinstance(cost, RobustCost) else cost
            if not isinstance(each, QuadraticCost):
                continue
            parts = [dataclasses.replace(each, w2=0.0), dataclasses.replace(each, w1=0.0)]
            sums = evaluate(self.experiments, self.space.base, parts).sum(axis=0)
            total = float(sums.sum())
            share = float(sums.max()) / total if 0.0 < total < np.inf else 0.0
            if share > MOST_SHARE and (sums > 0.0).all():
                large, small = ("the error", "the energy")[:: 1 if sums[0] > sums[1] else -1]
                warnings.warn(
                    f"{large} is {100.0 * share:.1f} % of the cost at the start, so that the "
                    f"search hardly looks at {small}: weigh them by w1 and w2, or take "
                    "TrackingCost",
                    FpidWarning,
                    stacklevel=3,
                )

    def to_dict(self) -> dict[str, Any]:
        """Return all that decides what a candidate costs, and which there are."""
        return {
            "experiment": [descriptions.to_dict(each) for each in self.experiments],
            "controller": descriptions.to_dict(self.space.base),
            "space": self.space.space.to_dict(),
            # A default follows from the others.
            "cost": [{} if cost is None else descriptions.to_dict(cost) for cost in self._given],
        }

    @contextmanager
    def using(self, executor: Executor | None, workers: int | None) -> Iterator[None]:
        """Let an executor, or so many workers, do the work of this block."""
        with executor_of(executor, workers, self.experiments, [self.space.base]) as self._executor:
            yield

    def costs_of(
        self, controllers: Sequence[Controller], progress: ProgressCallback | None = None
    ) -> FloatArray:
        """Return the costs of controllers over all experiments, (controllers, costs).

        They are +inf where a run diverged. Workers that die twice over the same runs are left alone
        from then on, with a warning; the work goes on here, and the results are the same.
        """
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
            return self.costs_of(controllers, progress)
        cube = table.reshape(len(self.experiments), count, len(self.costs))
        columns = [over_scenarios(cost, cube[:, :, k]) for k, cost in enumerate(self.costs)]
        return np.stack(columns, axis=1)


def resolved(controller: Controller, experiment: Experiment, space: Space) -> Controller:
    """Return what a law is on an arm, where that has all parameters of a space."""
    # Imported late: it loads numba.
    from fpid_pin.simulation.engine import horizon_of

    law = controller.on(
        experiment.arm, step=experiment.step, horizon=horizon_of(experiment.duration)
    )
    return law if set(space.genes) <= set(descriptions.keys(type(law))) else controller


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
                arm = base.resolve(experiment.arm).arm.with_payload(mass)
                true = dataclasses.replace(base, arm=arm, payload=None)
            varied.append(dataclasses.replace(experiment, plant=true))
    return varied
