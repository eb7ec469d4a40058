"""The cost over the square of orders, (lambda, mu)."""

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
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.problem import one_cost, problem_of
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
    costs = one_cost(cost)
    experiments, bound = problem_of(experiment, controller, space, costs)
    candidates = [
        cast(
            "Controller",
            dataclasses.replace(cast("Any", controller), integral_order=a, derivative_order=b),
        )
        for a in rows.tolist()
        for b in columns.tolist()
    ]
    with executor_of(executor, workers, experiments, [controller]) as pool:
        table = Objective(experiments, bound, costs, pool).of(candidates, progress)
    return CostMap(rows, columns, table.reshape(len(rows), len(columns)))
