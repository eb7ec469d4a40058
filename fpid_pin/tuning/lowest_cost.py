"""`tune`: the parameters that cost least."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fpid_pin import checks
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.simulation import Experiment
from fpid_pin.tuning.history import TuningResult
from fpid_pin.tuning.problem import one_cost, searched
from fpid_pin.tuning.search_progress import SearchCallback
from fpid_pin.tuning.settings import SearchSettings, checked
from fpid_pin.tuning.space import Space


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
        One, or several that every candidate goes through (see `RobustCost`, `scenarios`).
    controller
        All that `space` does not name stays as it is here.
    space
        Parameters to be changed, with bounds.
    cost
        To be made small; None: eq. (33) with its default weights. Over several experiments a
        `RobustCost` says how to reduce, any other cost is averaged.
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
    settings = checked(settings)
    search = searched(experiment, controller, space, one_cost(cost), settings, progress)
    bound = search.space
    points, costs = [], []
    for evolution in search.evolutions:
        best = int(np.argmin(evolution.costs[:, 0]))
        points.append(evolution.points[best])
        costs.append(float(evolution.costs[best, 0]))
    winner = int(np.argmin(costs))
    history = search.history()
    found, cost_found = bound.controller(points[winner], "tuned"), costs[winner]
    if search.start_cost < cost_found:
        # The start lies outside of the space, or the whole of it is worse.
        found, cost_found = bound.renamed("tuned"), search.start_cost
    return TuningResult(
        controller=found,
        cost=cost_found,
        start_cost=search.start_cost,
        parameters=bound.parameters(found),
        at_bounds=bound.at_bounds(bound.nearest(found)),
        controllers=tuple(
            bound.controller(point, f"tuned, seed {seed}")
            for point, seed in zip(points, settings.seeds, strict=True)
        ),
        costs=checks.read_only(costs),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=search.simulations,
    )
