"""The cost over the square of orders, (lambda, mu)."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.simulation import Cost, Experiment, QuadraticCost
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.problem import check_experiments, executor_of
from fpid_pin.tuning.space import Space

DEFAULT_GRID = tuple(np.linspace(0.0, 1.0, 21).tolist())


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
    progress: Callable[[float], None] | None = None,
) -> CostMap:
    """Evaluate a controller at every pair of orders.

    Parameters
    ----------
    experiment, cost, executor, workers
        See `tune`.
    controller
        One with `integral_order` and `derivative_order`; all else stays as it is.
    integral_orders, derivative_orders
        The grid's values, for all joints alike.
    progress
        Called with the part done, 0 to 1.

    Raises
    ------
    ArgumentError
        Orders outside [0, 1], or a controller without orders.
    """
    experiments = [experiment] if isinstance(experiment, Experiment) else list(experiment)
    check_experiments(experiments)
    rows = checks.floats("integral_orders", integral_orders, low=0.0, high=1.0, max_ndim=1)
    columns = checks.floats("derivative_orders", derivative_orders, low=0.0, high=1.0, max_ndim=1)
    rows, columns = np.atleast_1d(rows), np.atleast_1d(columns)
    space = Space(integral_order=(0, 1, "shared"), derivative_order=(0, 1, "shared"))
    bound = space.bind(controller, experiments[0].arm.n)
    candidates = [
        cast(
            "Controller",
            dataclasses.replace(cast("Any", controller), integral_order=a, derivative_order=b),
        )
        for a in rows.tolist()
        for b in columns.tolist()
    ]
    with executor_of(executor, workers) as pool:
        objective = Objective(experiments, bound, [cost or QuadraticCost()], pool)
        costs = objective.of(candidates, progress)[:, 0]
    return CostMap(rows, columns, costs.reshape(len(rows), len(columns)))
