"""What `tune`, `pareto` and their kin have in common: checks, executors, the search itself."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Cost, Experiment
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.search import Progress, Search
from fpid_pin.tuning.settings import Settings
from fpid_pin.tuning.space import BoundSpace, Space
from fpid_pin.tuning.workers import WorkerPool


def count(experiment: Experiment | Sequence[Experiment]) -> int:
    """Return the number of runs for each candidate."""
    return 1 if isinstance(experiment, Experiment) else len(experiment)


def searched(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: list[Cost],
    settings: Settings,
    initial: Sequence[Controller],
    executor: Executor | None,
    workers: int | None,
    checkpoint: str | Path | None,
    resume: bool,
    progress: Progress | None,
) -> tuple[Search, BoundSpace]:
    """Check what `tune` and `pareto` were given, search, and return the search and its space."""
    experiments = [experiment] if isinstance(experiment, Experiment) else list(experiment)
    check_experiments(experiments)
    checks.instance("controller", controller, Controller, "a Controller")
    checks.instance("space", space, Space, "a Space")
    for k, cost in enumerate(costs):
        checks.instance(f"costs.{k}" if len(costs) > 1 else "cost", cost, Cost, "a Cost")
    n = experiments[0].arm.n
    bound = space.bind(controller, n)
    if len(initial) > settings.population:
        raise ArgumentError("initial", f"at most {settings.population} (population)", len(initial))
    first = np.array([bound.point(c, n) for c in initial]).reshape(-1, bound.size)
    with executor_of(executor, workers) as pool:
        search = Search(
            Objective(experiments, bound, costs, pool),
            bound,
            len(costs),
            settings,
            initial=first,
            configuration=configuration(experiments, controller, space, costs, settings, first),
            checkpoint=None if checkpoint is None else Path(checkpoint),
        )
        search.prepare(resume)
        search.run(progress)
    return search, bound


def check_experiments(experiments: Sequence[Experiment]) -> None:
    """Check that there are experiments, and that one controller fits them all."""
    if not experiments:
        raise ArgumentError("experiment", "at least one", "none")
    for experiment in experiments:
        checks.instance("experiment", experiment, Experiment, "an Experiment")
    sizes = sorted({experiment.arm.n for experiment in experiments})
    if len(sizes) > 1:
        raise ArgumentError("experiment", "arms with one number of joints", sizes)


def executor_of(
    executor: Executor | None, workers: int | None
) -> AbstractContextManager[Executor | None]:
    """Return the caller's executor, which stays open, or a pool of our own, which is closed."""
    if executor is not None:
        if workers is not None:
            raise ArgumentError("workers", "workers or executor, not both", workers)
        return nullcontext(executor)
    return nullcontext(None) if workers is None else WorkerPool(workers)


def configuration(
    experiments: Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
    settings: Settings,
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
