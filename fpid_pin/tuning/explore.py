"""The cost around a controller: along each parameter, and over the square of orders."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.entry import executor_of
from fpid_pin.tuning.entry import one_cost, problem_of
from fpid_pin.tuning.robust import Objective
from fpid_pin.tuning.space import Space

#: Part of a parameter's range by which it is moved to see whether it matters.
NUDGE = 0.1
DEFAULT_GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())


@dataclass(frozen=True, eq=False)
class Profile:
    """Costs along each parameter in turn.

    Attributes
    ----------
    labels
        Of the parameters, as in `History`.
    values, costs
        (parameters, K); +inf where the run diverges.
    nudged
        (parameters, 2): the cost with the parameter a tenth of its range lower and higher, or at
        its bound where that is nearer.
    cost
        The controller's own.
    """

    labels: tuple[str, ...]
    values: FloatArray
    costs: FloatArray
    nudged: FloatArray
    cost: float

    @property
    def rises(self) -> FloatArray:
        """By what part of the cost it rises when a parameter moves a tenth of its range, at most.

        (parameters,); about 0: the parameter could be left out of the search.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.nudged.max(axis=1) / self.cost - 1.0)


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
    costs = one_cost(cost)
    experiments, bound = problem_of(experiment, controller, space, costs)
    own = bound.point(controller)
    candidates = np.tile(own, (bound.size, count + 2, 1))
    for k in range(bound.size):
        nudged = max(own[k] - NUDGE, 0.0), min(own[k] + NUDGE, 1.0)
        candidates[k, :, k] = np.append(np.linspace(0.0, 1.0, count), nudged)
    laws = [bound.controller(point) for point in candidates.reshape(-1, bound.size)]
    with executor_of(executor, workers, experiments, [controller]) as pool:
        found = Objective(experiments, costs, pool)([*laws, controller], progress)[:, 0]
    table = found[:-1].reshape(bound.size, count + 2)
    values = bound.values(candidates)
    along = np.stack([values[k, :count, k] for k in range(bound.size)])
    return Profile(bound.labels, along, table[:, :count], table[:, count:], float(found[-1]))


@dataclass(frozen=True, eq=False)
class CostMap:
    """Costs of orders that all joints share.

    Attributes
    ----------
    integral_orders, derivative_orders
        lambda, (L,), and mu, (M,).
    costs
        (L, M); +inf where the run diverges.
    """

    integral_orders: FloatArray
    derivative_orders: FloatArray
    costs: FloatArray

    @property
    def best(self) -> tuple[float, float]:
        """(lambda, mu) of the lowest cost on the grid."""
        i, j = divmod(int(np.argmin(self.costs)), self.costs.shape[1])
        return float(self.integral_orders[i]), float(self.derivative_orders[j])


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
    rows = checks.floats("integral_orders", integral_orders, low=0.0, high=1.0, max_ndim=1)
    columns = checks.floats("derivative_orders", derivative_orders, low=0.0, high=1.0, max_ndim=1)
    rows, columns = np.atleast_1d(rows), np.atleast_1d(columns)
    space = Space(integral_order=(0, 1, "shared"), derivative_order=(0, 1, "shared"))
    costs, base = one_cost(cost), cast("Any", controller)
    experiments, _ = problem_of(experiment, controller, space, costs)
    candidates: list[Controller] = [
        dataclasses.replace(base, integral_order=a, derivative_order=b)
        for a in rows.tolist()
        for b in columns.tolist()
    ]
    with executor_of(executor, workers, experiments, [controller]) as pool:
        table = Objective(experiments, costs, pool)(candidates, progress)
    return CostMap(rows, columns, table.reshape(len(rows), len(columns)))
