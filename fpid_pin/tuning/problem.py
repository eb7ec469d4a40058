"""What `tune`, `pareto` and their kin have in common: checks, and the search itself."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.budget import require_memory, require_time
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.simulation import Experiment, evaluate
from fpid_pin.simulation.entry import executor_of, warm
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.search import Search
from fpid_pin.tuning.search_progress import SearchCallback
from fpid_pin.tuning.settings import SearchSettings
from fpid_pin.tuning.space import BoundSpace, Space

#: What a candidate takes in its generation, measured for two joints.
_RUN_BYTES = 6e3


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
    check_experiments(experiments)
    experiments = [e.with_dynamics("compiled") for e in experiments]
    checks.instance("controller", controller, Controller, "a Controller")
    checks.instance("space", space, Space, "a Space")
    for k, cost in enumerate(costs):
        checks.instance(f"costs.{k}" if len(costs) > 1 else "cost", cost, Cost, "a Cost")
    return experiments, space.bind(controller, experiments[0].arm.n)


def searched(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: list[Cost],
    settings: SearchSettings,
    progress: SearchCallback | None,
) -> Search:
    """Check what `tune` and `pareto` were given, search, and return the search at its end."""
    experiments, bound = problem_of(experiment, controller, space, costs)
    n = experiments[0].arm.n
    _require_means(experiments, settings)
    points = [bound.point(start, n) for start in settings.initial]
    if len(points) < settings.population:
        # Where the search starts from takes part in it, moved into the space where it is outside.
        points.append(bound.nearest(controller))
    first = np.array(points).reshape(-1, bound.size)
    with executor_of(settings.executor, settings.workers, experiments, [controller]) as pool:
        search = Search(
            Objective(experiments, bound, costs, pool),
            bound,
            len(costs),
            settings,
            initial=first,
            configuration=configuration(experiments, controller, space, costs, settings, first),
        )
        with search.alone():
            search.prepare()
            if controller.control is not None:
                _warn_of_python(experiments, controller, settings, search.done)
            search.run(progress)
    return search


def _require_means(experiments: Sequence[Experiment], settings: SearchSettings) -> None:
    """Refuse a search that memory is too small or life too short for."""
    seeds, runs = len(settings.seeds), settings.population * len(experiments)
    rows, joints = sum(e.rows for e in experiments), experiments[0].arm.n
    what = f"{seeds} seeds of {runs} runs"
    require_memory("search", f"{what} in a generation", seeds * runs * _RUN_BYTES)
    require_time(
        "search",
        f"{what} of {max(e.rows for e in experiments):.3g} rows, {settings.generations} times",
        float(seeds * settings.population * settings.generations * rows * joints)
        / workers_of(settings),
    )


def _warn_of_python(
    experiments: Sequence[Experiment], controller: Controller, settings: SearchSettings, done: int
) -> None:
    """Say how long a law in plain Python will take, by the first run of the one that is given."""
    warm(experiments, [controller] * len(experiments))
    start = time.perf_counter()
    evaluate(experiments, controller)
    each = time.perf_counter() - start
    candidates = settings.population * len(settings.seeds) * (settings.generations - done)
    seconds = candidates * each / workers_of(settings)
    warnings.warn(
        f"{type(controller).__name__} is a law in plain Python: {candidates} candidates of "
        f"{each:.2g} s each take about {_spoken(seconds)}; in the joint form, torque(c), it is "
        "compiled (CONTRIBUTING.md)",
        FpidWarning,
        stacklevel=4,
    )


def _spoken(seconds: float) -> str:
    for unit, size in (("days", 86400.0), ("h", 3600.0), ("min", 60.0)):
        if seconds >= size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds:.2g} s"


def workers_of(settings: SearchSettings) -> int:
    """Return how many candidates are simulated at once, where an executor tells."""
    return settings.workers or int(getattr(settings.executor, "_max_workers", 1))


def check_experiments(experiments: Sequence[Experiment]) -> None:
    """Check that there are experiments, and that one controller fits them all."""
    if not experiments:
        raise ArgumentError("experiment", "at least one", "none")
    for experiment in experiments:
        checks.instance("experiment", experiment, Experiment, "an Experiment")
    sizes = sorted({experiment.arm.n for experiment in experiments})
    if len(sizes) > 1:
        raise ArgumentError("experiment", "arms with one number of joints", sizes)


def configuration(
    experiments: Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
    settings: SearchSettings,
    first: FloatArray,
) -> dict[str, Any]:
    """Return all that decides the result, except how many generations it goes on for."""
    return {
        "experiment": [descriptions.to_dict(e) for e in experiments],
        "controller": descriptions.to_dict(controller),
        "space": space.to_dict(),
        "cost": [descriptions.to_dict(cost) for cost in costs],
        "population": settings.population,
        "crossover": settings.crossover,
        "mutation": settings.mutation,
        "seeds": list(settings.seeds),
        "initial": first.tolist(),
        "reuse": settings.reuse,
    }
