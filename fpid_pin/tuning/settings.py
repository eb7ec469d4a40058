"""How to search: what `tune`, `pareto` and `cross_check` have in common."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from fpid_pin import checks
from fpid_pin.checks import Flag, Number, Whole
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.workers import check_workers


@dataclass(frozen=True)
class SearchSettings(Description):
    """How to search; the defaults are the paper's (section 5.1), in this process.

    Parameters
    ----------
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
    workers
        Number of workers: threads for compiled laws and dynamics, else processes; None: one run
        after another. The result is the same to the last bit whichever is chosen.
    executor
        Any `concurrent.futures.Executor`, in place of `workers`; it stays open.
    checkpoint
        File that is replaced, atomically, after every generation.
    resume
        Go on from `checkpoint` where there is one: the result is that of a search never stopped.
        `generations` may have grown since.

    Raises
    ------
    ArgumentError
        What is out of range, or does not go together.
    """

    population: Annotated[int, Whole(low=4)] = 60
    generations: Annotated[int, Whole(low=1)] = 80
    crossover: Annotated[float, Number(low=0.0, high=1.0)] = 0.75
    mutation: Annotated[float, Number(low=0.0, high=1.0)] = 0.03
    seeds: Sequence[int] = (0,)
    initial: Sequence[Controller] = ()
    reuse: Annotated[bool, Flag] = True
    workers: int | None = None
    executor: Executor | None = None
    checkpoint: str | Path | None = None
    resume: Annotated[bool, Flag] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set(seeds=self._checked_seeds(), initial=self._checked_initial())
        check_workers(self.executor, self.workers)
        if self.checkpoint is not None:
            checks.instance("checkpoint", self.checkpoint, (str, Path), "a path")
            self._set(checkpoint=Path(self.checkpoint))
        elif self.resume:
            raise ArgumentError("resume", "a checkpoint to resume from", "none")

    def _checked_seeds(self) -> tuple[int, ...]:
        given = _several(self.seeds)
        seeds = tuple(checks.integer(f"seeds.{k}", seed, low=0) for k, seed in enumerate(given))
        if not seeds:
            raise ArgumentError("seeds", "at least one", "none")
        if len(set(seeds)) < len(seeds):
            raise ArgumentError("seeds", "each seed once", list(seeds))
        return seeds

    def _checked_initial(self) -> tuple[Controller, ...]:
        initial = tuple(self.initial)
        if len(initial) > self.population:
            raise ArgumentError("initial", f"at most {self.population} (population)", len(initial))
        return initial


def _several(value: Any) -> tuple[Any, ...]:
    """Return a tuple, also where one thing stands for itself."""
    alone = isinstance(value, str) or not isinstance(value, Iterable)
    return (value,) if alone else tuple(value)


def checked(settings: SearchSettings | None) -> SearchSettings:
    """Return what a search was given; None: the defaults."""
    if settings is None:
        return SearchSettings()
    checks.instance("settings", settings, SearchSettings, "SearchSettings")
    return settings
