"""`tune` and `pareto`: the ways into a search."""

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
from fpid_pin.simulation import Cost, Experiment, QuadraticCost
from fpid_pin.tuning.history import ParetoResult, TuningResult
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.search import Progress, Search, Settings
from fpid_pin.tuning.space import BoundSpace, Space
from fpid_pin.tuning.workers import WorkerPool


def tune(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    *,
    population: int = 60,
    generations: int = 80,
    crossover: float = 0.75,
    mutation: float = 0.03,
    seeds: Sequence[int] = (0,),
    initial: Sequence[Controller] = (),
    reuse: bool = True,
    executor: Executor | None = None,
    workers: int | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> TuningResult:
    """Find the parameters of a controller that cost least, by a genetic algorithm.

    The defaults are the paper's (section 5.1): 60 individuals, 80 generations with the first,
    crossover 0.75, mutation 0.03.

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
    population, generations
        Candidates in a generation (at least 4), and generations, the first one included.
    crossover, mutation
        Probability that two parents are crossed, and that a parameter is mutated.
    seeds
        A search of its own for each; all run together as one larger population. A seed's result
        does not depend on the others.
    initial
        Controllers that take part in the first generation of every seed.
    reuse
        Take over the cost of a candidate that equals, to the last bit, one of the present
        population, in place of simulating it again. The result is the same.
    executor
        Any `concurrent.futures.Executor` of processes; the runs are dealt out to it.
    workers
        Number of worker processes of our own, in place of `executor`; None: this process alone.
        The result is the same to the last bit whichever is chosen.
    checkpoint
        File that is replaced, atomically, after every generation.
    resume
        Go on from `checkpoint` where there is one: the result is that of a search never stopped.
        `generations` may have grown since.
    progress
        Called with a `Report` now and then.

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
    if isinstance(cost, Sequence):
        raise ArgumentError("cost", "one cost (several: use pareto)", f"{len(cost)}")
    chosen = QuadraticCost() if cost is None else cost
    settings = Settings(population, generations, crossover, mutation, tuple(seeds), reuse)
    search, space_ = _search(
        experiment, controller, space, [chosen], settings,
        initial, executor, workers, checkpoint, resume, progress,
    )  # fmt: skip
    points, costs = [], []
    for evolution in search.evolutions:
        best = int(np.argmin(evolution.costs[:, 0]))
        points.append(evolution.points[best])
        costs.append(float(evolution.costs[best, 0]))
    winner = int(np.argmin(costs))
    history = search.history()
    return TuningResult(
        controller=space_.controller(points[winner], "tuned"),
        cost=costs[winner],
        parameters=space_.members(points[winner]),
        controllers=tuple(
            space_.controller(point, f"tuned, seed {seed}")
            for point, seed in zip(points, settings.seeds, strict=True)
        ),
        costs=checks.read_only(costs),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=int(history.simulated.sum()) * _count(experiment),
    )


def pareto(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    costs: Sequence[Cost],
    *,
    population: int = 60,
    generations: int = 80,
    crossover: float = 0.75,
    mutation: float = 0.03,
    seeds: Sequence[int] = (0,),
    initial: Sequence[Controller] = (),
    reuse: bool = True,
    executor: Executor | None = None,
    workers: int | None = None,
    checkpoint: str | Path | None = None,
    resume: bool = False,
    progress: Progress | None = None,
) -> ParetoResult:
    """Find the trade-off between several costs, by NSGA-II.

    Parameters
    ----------
    costs
        At least two: ``(MetricCost("ise"), MetricCost("energy"))``.
    experiment, controller, space, population, generations, crossover, mutation, seeds, initial, \
reuse, executor, workers, checkpoint, resume, progress
        See `tune`.

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
    settings = Settings(population, generations, crossover, mutation, tuple(seeds), reuse)
    search, space_ = _search(
        experiment, controller, space, list(costs), settings,
        initial, executor, workers, checkpoint, resume, progress,
    )  # fmt: skip
    points = np.concatenate([evolution.points for evolution in search.evolutions])
    table = np.concatenate([evolution.costs for evolution in search.evolutions])
    front = _front(table)
    points, table = points[front], table[front]
    history = search.history()
    return ParetoResult(
        controllers=tuple(
            space_.controller(point, f"front {k + 1}") for k, point in enumerate(points)
        ),
        costs=checks.read_only(table),
        parameters=checks.read_only(space_.values(points)),
        history=history,
        evaluations=int(history.evaluations[-1]),
        simulations=int(history.simulated.sum()) * _count(experiment),
    )


def _count(experiment: Experiment | Sequence[Experiment]) -> int:
    return 1 if isinstance(experiment, Experiment) else len(experiment)


def _search(
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
            configuration=_configuration(experiments, controller, space, costs, settings, first),
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


def _configuration(
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


def _front(costs: FloatArray) -> list[int]:
    """Return the rows that no other row beats in every cost, by rising first cost, each once."""
    chosen: list[int] = []
    for k in sorted(range(len(costs)), key=lambda k: tuple(costs[k])):
        row = costs[k]
        beaten = any((costs[c] <= row).all() for c in chosen)
        if np.isfinite(row).all() and not beaten:
            chosen.append(k)
    return chosen
