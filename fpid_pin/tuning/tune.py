"""`tune`: the parameters that cost least."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.control.controller import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Cost, Experiment, QuadraticCost
from fpid_pin.tuning.history import TuningResult
from fpid_pin.tuning.problem import count, searched
from fpid_pin.tuning.search import Progress
from fpid_pin.tuning.settings import Settings
from fpid_pin.tuning.space import Space


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
    search, space_ = searched(
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
        simulations=int(history.simulated.sum()) * count(experiment),
    )
