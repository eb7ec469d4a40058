"""`tune` and `pareto`: the parameters that cost least, and the trade-off between several costs."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from datetime import timedelta

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.budget import require_memory, require_time
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.simulation import Experiment, evaluate
from fpid_pin.simulation.entry import executor_of, warm
from fpid_pin.tuning.results import ParetoResult, TuningResult
from fpid_pin.tuning.robust import Objective
from fpid_pin.tuning.search import Search
from fpid_pin.tuning.settings import SearchCallback, SearchSettings
from fpid_pin.tuning.space import BoundSpace, Space

#: What a candidate takes in its generation, measured for two joints [bytes].
_RUN_BYTES = 6e3


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
    search = _searched(experiment, controller, space, one_cost(cost), settings, progress)
    bound, history = search.space, search.history()
    bests = [int(np.argmin(evolution.costs[:, 0])) for evolution in search.evolutions]
    points = [evolution.points[k] for evolution, k in zip(search.evolutions, bests, strict=True)]
    costs = [float(e.costs[k, 0]) for e, k in zip(search.evolutions, bests, strict=True)]
    winner = int(np.argmin(costs))
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
            for point, seed in zip(points, history.seeds, strict=True)
        ),
        costs=checks.read_only(costs),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=search.simulations,
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
    if isinstance(costs, Cost) or len(costs) < 2:
        raise ArgumentError("costs", "at least two costs (one: use tune)", "one")
    search = _searched(experiment, controller, space, costs, settings, progress)
    bound, history = search.space, search.history()
    points = np.concatenate([evolution.points for evolution in search.evolutions])
    table = np.concatenate([evolution.costs for evolution in search.evolutions])
    front = _front(table)
    return ParetoResult(
        controllers=tuple(
            bound.controller(point, f"front {k + 1}") for k, point in enumerate(points[front])
        ),
        costs=checks.read_only(table[front]),
        parameters=checks.read_only(bound.values(points[front])),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=search.simulations,
    )


def _front(costs: FloatArray) -> list[int]:
    """Return the rows that no other row beats in every cost, by rising first cost, each once."""
    chosen: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: tuple(costs[k])):
        beaten = any((costs[c] <= costs[k]).all() for c in chosen)
        if np.isfinite(costs[k]).all() and not beaten:
            chosen.append(k)
    return chosen


def one_cost(cost: Cost | None) -> list[Cost]:
    """Return the only cost as a list; None: eq. (33) with its default weights."""
    if isinstance(cost, Sequence):
        raise ArgumentError("cost", "one cost (several: use pareto)", f"{len(cost)}")
    return [QuadraticCost() if cost is None else cost]


def problem_of(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
) -> tuple[list[Experiment], BoundSpace]:
    """Check what is to be made small, where; return the experiments and the space on its law.

    Where experiments do not say their dynamics, they are compiled.
    """
    experiments = [experiment] if isinstance(experiment, Experiment) else list(experiment)
    if not experiments:
        raise ArgumentError("experiment", "at least one", "none")
    for each in experiments:
        checks.instance("experiment", each, Experiment, "an Experiment")
    sizes = sorted({each.arm.n for each in experiments})
    if len(sizes) > 1:
        raise ArgumentError("experiment", "arms with one number of joints", sizes)
    checks.instance("controller", controller, Controller, "a Controller")
    checks.instance("space", space, Space, "a Space")
    for k, cost in enumerate(costs):
        checks.instance(f"costs.{k}" if len(costs) > 1 else "cost", cost, Cost, "a Cost")
    return [each.with_dynamics("compiled") for each in experiments], space.bind(
        controller, sizes[0]
    )


def _searched(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
    settings: SearchSettings | None,
    progress: SearchCallback | None,
) -> Search:
    """Check what `tune` and `pareto` were given, search, and return the search at its end."""
    settings = SearchSettings() if settings is None else settings
    checks.instance("settings", settings, SearchSettings, "SearchSettings")
    experiments, bound = problem_of(experiment, controller, space, costs)
    _require_means(experiments, settings)
    points = [bound.point(start) for start in settings.initial]
    if len(points) < settings.population:
        # Where the search starts from takes part in it, moved into the space where it is outside.
        points.append(bound.nearest(controller))
    # All that decides the result, except how many generations it goes on for.
    configuration = {
        "experiment": [descriptions.to_dict(e) for e in experiments],
        "controller": descriptions.to_dict(controller),
        "space": space.to_dict(),
        "cost": [descriptions.to_dict(cost) for cost in costs],
        "population": settings.population,
        "crossover": settings.crossover,
        "mutation": settings.mutation,
        "seeds": list(settings.seeds),
        "initial": np.array(points).tolist(),
    }
    with executor_of(settings.executor, settings.workers, experiments, [controller]) as pool:
        objective = Objective(experiments, costs, pool)
        search = Search(
            objective, bound, settings, initial=np.array(points), configuration=configuration
        )
        with search.alone():
            search.take_up()
            if controller.control is not None:
                _warn_of_python(experiments, controller, settings, search.done)
            search.run(progress)
    return search


def _require_means(experiments: Sequence[Experiment], settings: SearchSettings) -> None:
    """Refuse a search that memory is too small or life too short for."""
    runs, rows = settings.population * len(experiments), sum(e.rows for e in experiments)
    what = f"{len(settings.seeds)} seeds of {runs} runs"
    size = len(settings.seeds) * runs * _RUN_BYTES
    require_memory("search", f"{what} in a generation", size)
    longest = max(e.rows for e in experiments)
    steps = float(settings.candidates * settings.generations * rows * experiments[0].arm.n)
    what = f"{what} of {longest:.3g} rows, {settings.generations} times"
    require_time("search", what, steps / settings.at_once)


def _warn_of_python(
    experiments: Sequence[Experiment], controller: Controller, settings: SearchSettings, done: int
) -> None:
    """Say how long a law in plain Python will take, by the first run of the one that is given."""
    warm(experiments, [controller] * len(experiments))
    start = time.perf_counter()
    evaluate(experiments, controller)
    each = time.perf_counter() - start
    candidates = settings.candidates * (settings.generations - done)
    left = timedelta(seconds=round(candidates * each / settings.at_once))
    warnings.warn(
        f"{type(controller).__name__} is a law in plain Python: {candidates} candidates of "
        f"{each:.2g} s each take about {left} (h:min:s); in the joint form, torque(c), it is "
        "compiled (CONTRIBUTING.md)",
        FpidWarning,
        stacklevel=4,
    )
