"""Another optimiser on the same problem: if it finds something better, the first one failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.exceptions import ArgumentError, TuningError
from fpid_pin.progress import Progress
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.entry import executor_of
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.problem import one_cost, problem_of
from fpid_pin.tuning.search_progress import Narrator, SearchCallback
from fpid_pin.tuning.settings import SearchSettings, checked
from fpid_pin.tuning.space import Space


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """What differential evolution found.

    Attributes
    ----------
    controller, cost
        The best of all seeds.
    costs
        The best cost of each seed, (S,).
    evaluations
        Candidates simulated, all seeds together.
    """

    controller: Controller
    cost: float
    costs: FloatArray
    evaluations: int


def cross_check(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    settings: SearchSettings | None = None,
    *,
    progress: SearchCallback | None = None,
) -> CrossCheck:
    """Search by SciPy's differential evolution (Storn and Price 1997), whole generations at once.

    Parameters
    ----------
    experiment, controller, space, cost
        See `tune`.
    settings
        The budget, `population`, `generations` and `seeds`, and the workers, as `tune` takes them;
        crossover, mutation, reuse and initial controllers are the genetic algorithm's own. SciPy
        takes whole multiples of the number of parameters, so the population may come out a little
        larger. Seeds go one after the other.
    progress
        Called with a `SearchProgress` now and then.

    Raises
    ------
    ArgumentError
        See `tune`; a checkpoint, which SciPy has no way to resume from.
    TuningError
        Every candidate diverged.
    """
    from scipy.optimize import differential_evolution

    settings = checked(settings)
    checks.integer("population", settings.population, low=5)
    if settings.checkpoint is not None:
        raise ArgumentError("checkpoint", "none for a cross-check", settings.checkpoint)
    costs = one_cost(cost)
    experiments, bound = problem_of(experiment, controller, space, costs)
    multiple = math.ceil(settings.population / bound.size)
    size = max(5, multiple * bound.size)
    narrator = Narrator(progress, settings.generations * len(settings.seeds), size)
    generation, best = 0, math.inf
    points: list[FloatArray] = []
    found: list[float] = []

    with executor_of(settings.executor, settings.workers, experiments, [controller]) as pool:
        objective = Objective(experiments, bound, costs, pool)

        def evaluated(columns: FloatArray) -> FloatArray:
            nonlocal generation, best
            generation += 1

            def told(inner: Progress) -> None:
                narrator.tell(generation, inner.part, best=best)

            rows = objective(np.ascontiguousarray(np.atleast_2d(columns.T)), told)[:, 0]
            best = min(best, float(rows.min()))
            narrator.tell(generation, 1.0, best=best, complete=True)
            return rows

        for seed in settings.seeds:
            end = differential_evolution(
                evaluated,
                [(0.0, 1.0)] * bound.size,
                popsize=multiple,
                maxiter=settings.generations - 1,
                tol=0.0,
                atol=0.0,
                rng=np.random.default_rng(seed),
                polish=False,
                vectorized=True,
                updating="deferred",
            )
            points.append(np.asarray(end.x))
            found.append(float(end.fun))
    winner = int(np.argmin(found))
    if not np.isfinite(found[winner]):
        raise TuningError(f"all {generation * size} candidates diverged; narrow the space")
    return CrossCheck(
        controller=bound.controller(points[winner], "differential evolution"),
        cost=found[winner],
        costs=checks.read_only(found),
        evaluations=generation * size,
    )
