"""What a search is asked: to make which cost small, over which plants and payloads, and how."""

import dataclasses
import warnings
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.checks import Flag, FloatArray, Number, OneOf, Whole, checked
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, MetricCost, Metrics, QuadraticCost, RowCost, TrackingCost
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError, FpidWarning, WorkersDied
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment, Plant, evaluate
from fpid_pin.simulation.experiment import default_cost
from fpid_pin.simulation.workers import check_workers, executor_of, workers_of
from fpid_pin.tuning.space import Space

REDUCTIONS = ("mean", "worst")
#: Of a cost's two terms, the most that one may be at the start without a warning.
MOST_SHARE = 0.9


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
        One search for each seed; all run together as one larger population. A seed's result
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


@described("robust_cost")
@dataclass(frozen=True, eq=False)
class RobustCost(Cost):
    """One number for a controller that has been through several experiments.

    Parameters
    ----------
    cost
        Of each run; None: what `tune` takes by default.
    reduce
        ``"mean"`` or ``"worst"`` over the experiments; a run that diverges makes both +inf.
    """

    _path = "robust_cost"

    cost: Cost | None = None
    reduce: Annotated[str, OneOf(*REDUCTIONS)] = "worst"

    def __post_init__(self) -> None:
        super().__post_init__()
        if isinstance(self.cost, RobustCost):
            raise ArgumentError("robust_cost.cost", "the cost of one run", "a RobustCost")

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`: the cost of one run alone."""
        return self._each.of(metrics)

    def streamed(self) -> RowCost | None:
        """See `Cost.streamed`."""
        return self._each.streamed()

    @property
    def _each(self) -> Cost:
        if self.cost is None:
            raise ArgumentError("robust_cost.cost", "a cost, outside of tune", "none")
        return self.cost


def over_scenarios(cost: Cost, table: FloatArray) -> FloatArray:
    """Reduce costs of each scenario, (scenarios, candidates), to (candidates,).

    A cost that says nothing about it is averaged. NaN counts as +inf: nothing may win by it.
    """
    sound = np.where(np.isnan(table), np.inf, table)
    if isinstance(cost, RobustCost) and cost.reduce == "worst":
        return np.asarray(sound.max(axis=0))
    # Row after row, so that a candidate's mean does not depend on how many candidates there are.
    return np.asarray(np.add.accumulate(sound)[-1] / len(sound))


class Problem:
    """What is made small, and what may be changed for it: checked, and the space on its law.

    A law that depends on the arm (`SuggestedFpid`) is first made what it is there, unless the space
    has parameters of its own, so that a candidate costs no new search for gains.
    """

    def __init__(
        self,
        experiment: Experiment | Sequence[Experiment],
        controller: Controller,
        space: Space,
        *costs: Cost | None,
    ) -> None:
        # Imported late: it loads numba.

        experiments = checks.several("experiment", experiment, Experiment, "an Experiment")
        if not experiments:
            raise ArgumentError("experiment", "at least one", "none")
        sizes = sorted({each.arm.n for each in experiments})
        if len(sizes) > 1:
            raise ArgumentError("experiment", "arms with one number of joints", sizes)
        checks.instance("controller", controller, Controller, "a Controller")
        checks.instance("space", space, Space, "a Space")
        for cost in costs:
            if cost is not None:
                checks.instance("cost", cost, Cost, "one cost (several: use pareto)")
        self._given = costs
        self.experiments = [each.with_dynamics("compiled") for each in experiments]
        first = self.experiments[0]
        law = controller.on(first.arm, step=first.step)
        has_all = set(space.genes) <= set(descriptions.keys(type(law)))
        self.space = space.bind(law if has_all else controller, sizes[0])
        self._executor: Executor | None = None

    @cached_property
    def costs(self) -> list[Cost]:
        """What is made small, with a default for what was left open: see `tune`."""
        found: list[Cost] = []
        for cost in self._given:
            if cost is None and len(self.experiments) > 1:
                cost = RobustCost()
            if cost is None:
                cost = self._default()
            elif isinstance(cost, RobustCost) and cost.cost is None:
                cost = dataclasses.replace(cost, cost=self._default())
            found.append(cost)
        return found

    def _default(self) -> Cost:
        """Return the default cost: where that is tracking, at no more variation than the start."""
        cost = default_cost(each.arm for each in self.experiments)
        if isinstance(cost, QuadraticCost):
            return cost
        variation = evaluate(self.experiments, self.space.base, MetricCost("total_variation"))
        finite = variation[np.isfinite(variation) & (variation > 0.0)]
        return TrackingCost(float(finite.max())) if finite.size else cost

    def warn_of_one_sided(self) -> None:
        """Warn where error or energy is nearly all of (33) at the start: it alone is made small."""
        for cost in self.costs:
            each = cost.cost if isinstance(cost, RobustCost) else cost
            if not isinstance(each, QuadraticCost):
                continue
            parts = [dataclasses.replace(each, w2=0.0), dataclasses.replace(each, w1=0.0)]
            sums = evaluate(self.experiments, self.space.base, parts).sum(axis=0)
            total = float(sums.sum())
            share = float(sums.max()) / total if 0.0 < total < np.inf else 0.0
            if share > MOST_SHARE and (sums > 0.0).all():
                large, small = ("the error", "the energy")[:: 1 if sums[0] > sums[1] else -1]
                warnings.warn(
                    f"{large} is {100.0 * share:.1f} % of the cost at the start, so that the "
                    f"search hardly looks at {small}: weigh them by w1 and w2, or take "
                    "TrackingCost",
                    FpidWarning,
                    stacklevel=3,
                )

    def to_dict(self) -> dict[str, Any]:
        """Return all that decides what a candidate costs, and which there are."""
        return {
            "experiment": [descriptions.to_dict(each) for each in self.experiments],
            "controller": descriptions.to_dict(self.space.base),
            "space": self.space.space.to_dict(),
            # A default follows from the others.
            "cost": [{} if cost is None else descriptions.to_dict(cost) for cost in self._given],
        }

    @contextmanager
    def using(self, executor: Executor | None, workers: int | None) -> Iterator[None]:
        """Let an executor, or so many workers, do the work of this block."""
        with executor_of(executor, workers, self.experiments, [self.space.base]) as self._executor:
            yield

    def costs_of(
        self, controllers: Sequence[Controller], progress: ProgressCallback | None = None
    ) -> FloatArray:
        """Return the costs of controllers over all experiments, (controllers, costs).

        They are +inf where a run diverged. Workers that die twice over the same runs are left alone
        from then on, with a warning; the work goes on here, and the results are the same.
        """
        count = len(controllers)
        # Experiment by experiment: what neighbouring runs are given from outside is sampled once.
        experiments = [e for e in self.experiments for _ in range(count)]
        runs = list(controllers) * len(self.experiments)
        try:
            table = evaluate(
                experiments, runs, self.costs, executor=self._executor, progress=progress
            )
        except WorkersDied as error:
            line = f"{error}; going on in this process, with the same results"
            warnings.warn(line, FpidWarning, stacklevel=2)
            self._executor = None
            return self.costs_of(controllers, progress)
        cube = table.reshape(len(self.experiments), count, len(self.costs))
        columns = [over_scenarios(cost, cube[:, :, k]) for k, cost in enumerate(self.costs)]
        return np.stack(columns, axis=1)


@checked
def scenarios(
    experiment: Experiment,
    *,
    plants: Iterable[Plant | None] = (),
    payloads: Iterable[float] = (),
) -> list[Experiment]:
    """Return variations of one experiment: every plant with every payload.

    Parameters
    ----------
    experiment
        The controller's belief, its reference and start stay as they are here.
    plants
        True robots; none given: the experiment's own.
    payloads
        Point masses at the arm's tool [kg] that the controller does not know of; none given: 0.

    Raises
    ------
    ArgumentError
        A negative payload, or a plant that does not fit the arm.
    """
    masses = [checks.number("payload", mass, low=0.0) for mass in payloads] or [0.0]
    varied = []
    for plant in list(plants) or [experiment.plant]:
        for mass in masses:
            true = plant
            if mass > 0.0:
                base = plant or Plant()
                arm = base.resolve(experiment.arm).arm.with_payload(mass)
                true = dataclasses.replace(base, arm=arm, payload=None)
            varied.append(dataclasses.replace(experiment, plant=true))
    return varied
