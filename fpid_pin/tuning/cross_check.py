"""Another optimiser on the same problem: if it finds something better, the first one failed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.exceptions import TuningError
from fpid_pin.simulation import Cost, Experiment, QuadraticCost
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.problem import check_experiments, executor_of
from fpid_pin.tuning.space import Space


@dataclass(frozen=True, eq=False)
class CrossCheck:
    """What differential evolution found.

    Attributes
    ----------
    controller, cost
        The best.
    evaluations
        Candidates simulated.
    """

    controller: Controller
    cost: float
    evaluations: int


def cross_check(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    *,
    population: int = 60,
    generations: int = 80,
    seed: int = 0,
    executor: Executor | None = None,
    workers: int | None = None,
) -> CrossCheck:
    """Search by SciPy's differential evolution (Storn and Price 1997), whole generations at once.

    Parameters
    ----------
    experiment, controller, space, cost, executor, workers
        See `tune`.
    population, generations
        The budget, as for `tune`: SciPy takes whole multiples of the number of parameters, so the
        population may come out a little larger.
    seed
        Of its random choices.

    Raises
    ------
    ArgumentError
        See `tune`.
    TuningError
        Every candidate diverged.
    """
    from scipy.optimize import differential_evolution

    experiments = [experiment] if isinstance(experiment, Experiment) else list(experiment)
    check_experiments(experiments)
    checks.integer("population", population, low=5)
    checks.integer("generations", generations, low=1)
    checks.integer("seed", seed, low=0)
    bound = space.bind(controller, experiments[0].arm.n)
    count = 0

    with executor_of(executor, workers) as pool:
        objective = Objective(experiments, bound, [cost or QuadraticCost()], pool)

        def costs(columns: FloatArray) -> FloatArray:
            nonlocal count
            points = np.ascontiguousarray(np.atleast_2d(columns.T))
            count += len(points)
            return objective(points)[:, 0]

        found = differential_evolution(
            costs,
            [(0.0, 1.0)] * bound.size,
            popsize=math.ceil(population / bound.size),
            maxiter=generations - 1,
            tol=0.0,
            atol=0.0,
            rng=np.random.default_rng(seed),
            polish=False,
            vectorized=True,
            updating="deferred",
        )
    if not np.isfinite(found.fun):
        raise TuningError(f"all {count} candidates diverged; narrow the space")
    return CrossCheck(
        bound.controller(np.asarray(found.x), "differential evolution"), float(found.fun), count
    )
