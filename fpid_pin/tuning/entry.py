"""`tune` and `pareto`, the searches; `profile` and `cost_map`, the cost around a controller."""

from collections.abc import Sequence
from concurrent.futures import Executor
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import checked
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.exceptions import ArgumentError
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment
from fpid_pin.tuning.problem import Problem, SearchSettings
from fpid_pin.tuning.results import CostMap, History, ParetoResult, Profile, TuningResult
from fpid_pin.tuning.search import Search, SearchCallback
from fpid_pin.tuning.space import Space

#: Part of a parameter's range by which it is moved to see whether it matters.
NUDGE = 0.1
DEFAULT_GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())


def tune(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    settings: SearchSettings | None = None,
    *,
    progress: SearchCallback | None = None,
) -> TuningResult:
    """Find the parameters of a controller that cost least, by a genetic algorithm.

    The controller itself takes part: the result is never worse than it.

    Parameters
    ----------
    experiment
        One, or several that every candidate goes through (see `RobustCost`, `scenarios`). Where
        they do not say their dynamics, these are compiled.
    controller
        All that `space` does not name stays as it is here.
    space
        Parameters to be changed, with bounds.
    cost
        To be made small; None: eq. (33) on the paper's arm, on others the worst joint's RMS error
        over the last half, at no more variation of the torque than the controller has now
        (`TrackingCost`); of several experiments the worst. A `RobustCost` says how to reduce, any
        other cost is averaged.
    settings
        How to search; None: the paper's population, generations and probabilities.
    progress
        Called with a `SearchProgress` now and then.

    Returns
    -------
    TuningResult

    Raises
    ------
    ArgumentError
        Before anything is simulated.
    TuningError
        A checkpoint of another search, or every candidate of a first generation diverged.
    FileFormatError
        A checkpoint cut short or altered, or a folder that cannot be written.
    """
    problem = Problem(experiment, controller, space, cost)
    search = Search(problem, settings)
    problem.warn_of_one_sided()
    search.run(progress)
    bound, found = search.space, search.summary()
    history: History = found["history"]
    costs, values = history.best[-1], history.best_parameters[-1]
    winner = int(np.argmin(costs))
    # The start lies outside of the space, or the whole of it is worse.
    kept = search.start_cost < costs[winner]
    return TuningResult(
        controller=bound.controller(None if kept else values[winner], "tuned"),
        cost=search.start_cost if kept else float(costs[winner]),
        start_cost=search.start_cost,
        space=bound,
        controllers=tuple(
            bound.controller(each, f"tuned, seed {seed}")
            for each, seed in zip(values, history.seeds, strict=True)
        ),
        costs=checks.read_only(costs),
        **found,
    )


def pareto(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
    settings: SearchSettings | None = None,
    *,
    progress: SearchCallback | None = None,
) -> ParetoResult:
    """Find the trade-off between several costs, by NSGA-II.

    Parameters
    ----------
    experiment, controller, space, settings, progress
        See `tune`.
    costs
        At least two: ``(MetricCost("ise"), MetricCost("energy"))``.

    Returns
    -------
    ParetoResult
        What no candidate in the last populations of all seeds beats in every cost.

    Raises
    ------
    ArgumentError, TuningError, FileFormatError
        See `tune`.
    """
    several = checks.several("costs", costs, Cost, "a Cost")  # type: ignore[type-abstract]
    if len(several) < 2:
        raise ArgumentError("costs", "at least two costs (one: use tune)", "one")
    search = Search(Problem(experiment, controller, space, *several), settings)
    search.run(progress)
    points = np.concatenate([evolution.points for evolution in search.evolutions])
    table = np.concatenate([evolution.costs for evolution in search.evolutions])
    front: list[int] = []
    for k in sorted(range(len(table)), key=lambda k: tuple(table[k])):
        beaten = any((table[other] <= table[k]).all() for other in front)
        if np.isfinite(table[k]).all() and not beaten:
            front.append(k)
    bound, values = search.space, search.space.values(points[front])
    return ParetoResult(
        controllers=tuple(bound.controller(x, f"front {k}") for k, x in enumerate(values, 1)),
        costs=checks.read_only(table[front]),
        parameters=checks.read_only(values),
        **search.summary(),
    )


@checked
def profile(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    *,
    points: int = 9,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> Profile:
    """Move each parameter of a controller over its range, the others held.

    Parameters
    ----------
    experiment, cost
        See `tune`.
    controller
        Inside of `space`, as one that `tune` has found.
    space
        The parameters, with their ranges.
    points
        Values of each.
    executor, workers
        See `SearchSettings`.
    progress
        Called with a `Progress` now and then.

    Raises
    ------
    ArgumentError
        A controller outside of the space.
    """
    count = checks.integer("points", points, low=2)
    problem = Problem(experiment, controller, space, cost)
    bound, own = problem.space, problem.space.point(controller)
    candidates = np.tile(own, (bound.size, count + 2, 1))
    for k in range(bound.size):
        nudged = max(own[k] - NUDGE, 0.0), min(own[k] + NUDGE, 1.0)
        candidates[k, :, k] = np.append(np.linspace(0.0, 1.0, count), nudged)
    values = bound.values(candidates)
    laws = [bound.controller(each) for each in values.reshape(-1, bound.size)]
    with problem.using(executor, workers):
        found = problem.costs_of([*laws, controller], progress)[:, 0]
    table = found[:-1].reshape(bound.size, count + 2)
    along = np.diagonal(values, axis1=0, axis2=2).T[:, :count]
    return Profile(bound.labels, along, table[:, :count], table[:, count:], float(found[-1]))


@checked
def cost_map(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    cost: Cost | None = None,
    *,
    integral_orders: ArrayLike = DEFAULT_GRID,
    derivative_orders: ArrayLike = DEFAULT_GRID,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> CostMap:
    """Evaluate a controller at every pair of orders.

    Parameters
    ----------
    experiment, cost
        See `tune`.
    controller
        One with `integral_order` and `derivative_order`; all else stays as it is.
    integral_orders, derivative_orders
        The grid's values, for all joints alike.
    executor, workers
        See `SearchSettings`.
    progress
        Called with a `Progress` now and then.

    Raises
    ------
    ArgumentError
        Orders outside [0, 1], or a controller without orders.
    """
    rows, columns = (
        np.atleast_1d(checks.floats(name, orders, low=0.0, high=1.0, max_ndim=1))
        for name, orders in (
            ("integral_orders", integral_orders), ("derivative_orders", derivative_orders)
        )
    )  # fmt: skip
    space = Space(integral_order=(0, 1, "shared"), derivative_order=(0, 1, "shared"))
    problem = Problem(experiment, controller, space, cost)
    laws = [problem.space.controller(np.array(pair)) for pair in product(rows, columns)]
    with problem.using(executor, workers):
        table = problem.costs_of(laws, progress)
    return CostMap(rows, columns, table.reshape(len(rows), len(columns)))
