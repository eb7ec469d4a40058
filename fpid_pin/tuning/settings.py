"""How to search, and where a search stands."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from fpid_pin import checks
from fpid_pin.checks import Flag, Number, Whole
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError
from fpid_pin.progress import Progress
from fpid_pin.simulation.workers import check_workers, workers_of


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
    workers: int | None = None
    executor: Executor | None = None
    checkpoint: str | Path | None = None
    resume: Annotated[bool, Flag] = False

    def __post_init__(self) -> None:
        super().__post_init__()
        seeds = self.seeds if isinstance(self.seeds, Iterable) else (self.seeds,)
        seeds = tuple(checks.integer(f"seeds.{k}", seed, low=0) for k, seed in enumerate(seeds))
        if not seeds or len(set(seeds)) < len(seeds):
            raise ArgumentError("seeds", "at least one, each once", list(seeds) or "none")
        if len(self.initial) > self.population:
            most = f"at most {self.population} (population)"
            raise ArgumentError("initial", most, len(self.initial))
        check_workers(self.executor, self.workers)
        if self.checkpoint is not None:
            checks.instance("checkpoint", self.checkpoint, (str, Path), "a path")
        elif self.resume:
            raise ArgumentError("resume", "a checkpoint to resume from", "none")
        self._set(seeds=seeds)

    @property
    def candidates(self) -> int:
        """Candidates in a generation of all seeds."""
        return self.population * len(self.seeds)

    @property
    def at_once(self) -> int:
        """How many are simulated at once, where an executor tells."""
        return self.workers or workers_of(self.executor)


@dataclass(frozen=True)
class SearchProgress(Progress):
    """Where a search stands.

    Attributes
    ----------
    part
        Of the whole search, 0 to 1.
    generation, generations
        The one at work, from 1; and how many there will be.
    complete
        Whether that generation is done, and its checkpoint written.
    best
        Lowest cost so far (the first of several), inf before the first generation is done.
    evaluations
        Candidates evaluated so far, all seeds together.
    rate
        Evaluations a second in this process [1/s], 0 before any is done.
    seconds_left
        At that rate [s]; NaN before any is done.
    """

    generation: int
    generations: int
    complete: bool
    best: float
    evaluations: int
    rate: float
    seconds_left: float


#: What ``progress=`` of a search takes; a `fpid_pin.progress.ProgressCallback` will do as well.
SearchCallback = Callable[[SearchProgress], None]
