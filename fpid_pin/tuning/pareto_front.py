"""`pareto`: the trade-off between several costs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment
from fpid_pin.tuning.history import ParetoResult
from fpid_pin.tuning.problem import searched
from fpid_pin.tuning.search_progress import SearchCallback
from fpid_pin.tuning.settings import SearchSettings, checked
from fpid_pin.tuning.space import Space


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
    if isinstance(costs, Cost) or len(costs) < 2:
        raise ArgumentError("costs", "at least two costs (one: use tune)", "one")
    search = searched(experiment, controller, space, list(costs), checked(settings), progress)
    bound = search.space
    points = np.concatenate([evolution.points for evolution in search.evolutions])
    table = np.concatenate([evolution.costs for evolution in search.evolutions])
    front = front_of(table)
    points, table = points[front], table[front]
    history = search.history()
    return ParetoResult(
        controllers=tuple(
            bound.controller(point, f"front {k + 1}") for k, point in enumerate(points)
        ),
        costs=checks.read_only(table),
        parameters=checks.read_only(bound.values(points)),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=search.simulations,
    )


def front_of(costs: FloatArray) -> list[int]:
    """Return the rows that no other row beats in every cost, by rising first cost, each once."""
    chosen: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: tuple(costs[k])):
        row = costs[k]
        beaten = any((costs[c] <= row).all() for c in chosen)
        if np.isfinite(row).all() and not beaten:
            chosen.append(k)
    return chosen
