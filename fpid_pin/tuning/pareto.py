"""`pareto`: the trade-off between several costs."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Cost, Experiment
from fpid_pin.tuning.history import ParetoResult
from fpid_pin.tuning.problem import count, searched
from fpid_pin.tuning.search import Progress
from fpid_pin.tuning.settings import Settings
from fpid_pin.tuning.space import Space


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
    search, space_ = searched(
        experiment, controller, space, list(costs), settings,
        initial, executor, workers, checkpoint, resume, progress,
    )  # fmt: skip
    points = np.concatenate([evolution.points for evolution in search.evolutions])
    table = np.concatenate([evolution.costs for evolution in search.evolutions])
    front = front_of(table)
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
        simulations=int(history.simulated.sum()) * count(experiment),
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
