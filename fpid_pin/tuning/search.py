"""The search itself: all seeds' populations in one call a generation, a checkpoint after each."""

import json
import math
import re
import time
import warnings
from collections.abc import Callable, Mapping
from contextlib import nullcontext
from dataclasses import dataclass
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import checks, npz
from fpid_pin._version import __version__
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.exceptions import FpidWarning, TuningError
from fpid_pin.files import kind_of, locked, require_file
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.resources import require_memory, require_time
from fpid_pin.simulation import evaluate, simulate
from fpid_pin.simulation.entry import warm
from fpid_pin.text import differences, listed
from fpid_pin.tuning.problem import Problem, SearchSettings
from fpid_pin.tuning.results import History

# In place of +inf, with which crowding distances would be NaN.
_HUGE = 1e300
# What a candidate takes in its generation, measured for two joints [bytes].
_RUN_BYTES = 6e3
_RECORDS = ("best", "mean", "best_parameters", "diverged", "simulated")


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


class Evolution:
    """One seed's population of points in the unit cube, by pymoo, with a state that is data.

    One cost: a genetic algorithm with binary tournaments and elitist survival. Several: NSGA-II
    (Deb, Pratap, Agarwal and Meyarivan 2002). Simulated binary crossover and polynomial mutation
    (Deb and Agrawal 1995) in both. The points `initial`, (k, size), k <= population, belong to the
    first generation; each point has so many `costs`.
    """

    def __init__(
        self, initial: FloatArray, costs: int, settings: SearchSettings, seed: int
    ) -> None:
        from pymoo.algorithms.moo.nsga2 import NSGA2
        from pymoo.algorithms.soo.nonconvex.ga import GA
        from pymoo.config import Config
        from pymoo.core.problem import Problem as Box
        from pymoo.core.termination import NoTermination
        from pymoo.operators.crossover.sbx import SBX
        from pymoo.operators.mutation.pm import PM

        Config.warnings["not_compiled"] = False
        self._initial, size = initial, initial.shape[1]
        #: The population that survived, and its costs: (population, size), (population, costs).
        self.points, self.costs = np.empty((0, size)), np.empty((0, costs))
        # What a member of a population has, in a checkpoint and in pymoo's own.
        self._kept = {"points": "X", "costs": "F"}
        if costs > 1:
            self._kept |= {"rank": "rank", "crowding": "crowding"}
        # prob_var = 1: a crossed pair is crossed in all coordinates; PM's own prob = 1: its
        # prob_var alone is then the probability for a coordinate.
        self._algorithm = (GA if costs == 1 else NSGA2)(
            pop_size=settings.population,
            crossover=SBX(prob=settings.crossover, prob_var=1.0),
            mutation=PM(prob=1.0, prob_var=settings.mutation),
            eliminate_duplicates=False,
        )
        box = Box(n_var=size, n_obj=costs, xl=0.0, xu=1.0)
        self._algorithm.setup(box, termination=NoTermination(), seed=seed)
        self._asked: Any = None

    def ask(self) -> FloatArray:
        """Return the points to be evaluated next, (population, size)."""
        first = not self._algorithm.is_initialized
        self._asked = self._algorithm.ask()
        points = np.array(self._asked.get("X"), dtype=np.float64)
        if first:
            points[: len(self._initial)] = self._initial
            self._asked.set("X", points)
        return points.copy()

    def tell(self, costs: FloatArray) -> None:
        """Give the costs of what was asked for, (population, costs), +inf where diverged."""
        self._asked.set("F", np.minimum(costs, _HUGE))
        self._algorithm.tell(infills=self._asked)
        self._read_population()

    def _read_population(self) -> None:
        costs = np.array(self._algorithm.pop.get("F"), dtype=np.float64)
        self.points = np.array(self._algorithm.pop.get("X"), dtype=np.float64)
        self.costs = np.where(costs >= _HUGE, np.inf, costs)

    def state(self) -> dict[str, Any]:
        """Return all that the next generation depends on: arrays, and a text."""
        algorithm = self._algorithm
        state = {name: np.array(algorithm.pop.get(own)) for name, own in self._kept.items()}
        state["random"] = np.array(json.dumps(algorithm.random_state.bit_generator.state))
        state["generation"] = np.array(algorithm.n_iter)
        return state

    def restore(self, state: Mapping[str, Any]) -> None:
        """Take up what `state` returned: everything after is the same to the last bit."""
        from pymoo.core.population import Population

        algorithm = self._algorithm
        algorithm.pop = Population.new(**{own: state[name] for name, own in self._kept.items()})
        algorithm.is_initialized = True
        algorithm.n_iter = int(state["generation"])
        algorithm.start_time = 0.0
        algorithm.random_state.bit_generator.state = json.loads(str(state["random"]))
        self._read_population()


class Search:
    """A search from its settings to its last generation: evolutions of all seeds, side by side."""

    def __init__(self, problem: Problem, settings: SearchSettings | None) -> None:
        settings = SearchSettings() if settings is None else settings
        checks.instance("settings", settings, SearchSettings, "SearchSettings")
        self.problem, self.space, self.settings = problem, problem.space, settings
        self._require_means()
        points = [self.space.point(start) for start in settings.initial]
        if len(points) < settings.population:
            # Where the search starts from takes part in it, moved into the space where outside.
            points.append(self.space.nearest(self.space.base))
        initial = np.array(points)
        # All that decides the result, except how many generations it goes on for; as it is read
        # back from a file. Objects of a user's own appear as their repr; its address changes from
        # process to process.
        table = problem.to_dict()
        table |= {key: getattr(settings, key) for key in ("population", "crossover", "mutation")}
        table |= {"seeds": list(settings.seeds), "initial": initial.tolist()}
        self._configuration = json.loads(re.sub(r" at 0x[0-9a-fA-F]+", "", json.dumps(table)))
        self._checkpoint = None if settings.checkpoint is None else Path(settings.checkpoint)
        self.evolutions = [
            Evolution(initial, len(problem.costs), settings, seed) for seed in settings.seeds
        ]
        self.done = 0
        self.start_cost = math.inf
        self._records: dict[str, list[Any]] = {name: [] for name in _RECORDS}

    def _require_means(self) -> None:
        """Refuse a search that memory is too small or life too short for."""
        experiments, settings = self.problem.experiments, self.settings
        runs, rows = settings.population * len(experiments), [e.rows for e in experiments]
        what = f"{len(settings.seeds)} seeds of {runs} runs"
        size = len(settings.seeds) * runs * _RUN_BYTES
        require_memory("search", f"{what} in a generation", size)
        steps = float(settings.candidates * settings.generations * sum(rows) * self.space.n)
        what = f"{what} of {max(rows):.3g} rows, {settings.generations} times"
        require_time("search", what, steps / settings.at_once)

    @checks.checked
    def run(self, progress: SearchCallback | None) -> None:
        """Search to the last generation, from the checkpoint where there is one."""
        settings, path = self.settings, self._checkpoint
        # Another search that wants the same checkpoint is refused.
        alone = nullcontext() if path is None else locked(path)
        with self.problem.using(settings.executor, settings.workers), alone:
            if path is not None:
                self._resume(path)
            if self.space.base.control is not None:
                self._warn_of_python()
            # By itself: a point of the unit cube gives it back to within rounding only.
            self.start_cost = float(self.problem.costs_of([self.space.base])[0, 0])
            self._run_generations(progress)

    def _warn_of_python(self) -> None:
        """Say how long a law in plain Python will take, by the first run of the one given."""
        experiments, law, settings = self.problem.experiments, self.space.base, self.settings
        warm(experiments, [law] * len(experiments))
        start = time.perf_counter()
        evaluate(experiments, law)
        each = time.perf_counter() - start
        candidates = settings.candidates * (settings.generations - self.done)
        left = timedelta(seconds=round(candidates * each / settings.at_once))
        warnings.warn(
            f"{type(law).__name__} is a law in plain Python: {candidates} candidates of "
            f"{each:.2g} s each take about {left} (h:min:s); in the joint form, torque(c), it is "
            "compiled (CONTRIBUTING.md)",
            FpidWarning,
            stacklevel=5,
        )

    # ------------------------------------------------------------------ checkpoints

    def _resume(self, path: Path) -> None:
        """Go on from a checkpoint, where there is one; refuse another search's."""
        require_file(path)
        if kind_of(path) is None:
            return
        if not self.settings.resume:
            raise TuningError(
                f"{path}: there is a checkpoint of an earlier search: resume it, or remove it"
            )
        arrays, table = npz.read(path, "checkpoint")
        found = differences(table["configuration"], self._configuration)
        if found:
            raise TuningError(f"{path}: a checkpoint of another search: {listed(found, str)}")
        self.done, most = table["done"], self.settings.generations
        if self.done > most:
            raise TuningError(f"{path}: generations is {most} here, and {self.done} are done")
        if found := differences(table["versions"], _versions()):
            words = "written with other versions, so the last bits may differ"
            warnings.warn(f"{path}: {words}: {'; '.join(found)}", FpidWarning, stacklevel=5)
        for name in _RECORDS:
            self._records[name] = list(arrays.pop(f"history_{name}"))
        for k, evolution in enumerate(self.evolutions):
            evolution.restore({name: array[k] for name, array in arrays.items()})

    def _save(self) -> None:
        if self._checkpoint is None:
            return
        states = [evolution.state() for evolution in self.evolutions]
        arrays = {name: np.array([state[name] for state in states]) for name in states[0]}
        arrays |= {f"history_{name}": np.array(rows) for name, rows in self._records.items()}
        table = {"configuration": self._configuration, "done": self.done, "versions": _versions()}
        npz.write(self._checkpoint, "checkpoint", table, arrays)

    # ------------------------------------------------------------------ generations

    def _run_generations(self, progress: SearchCallback | None) -> None:
        settings, before, began = self.settings, self.done, time.monotonic()

        def report(part: float, complete: bool = False) -> None:
            if progress is None:
                return
            done, all_ = self.done + part, settings.generations
            seconds = max(time.monotonic() - began, 1e-9)
            rate = (done - before) * settings.candidates / seconds
            left = (all_ - done) * settings.candidates / rate if rate > 0.0 else math.nan
            best = float(np.min(self._records["best"][-1][..., 0])) if self.done else math.inf
            progress(SearchProgress(
                done / all_, self.done + (not complete), all_, complete, best,
                round(done * settings.candidates), rate, left,
            ))  # fmt: skip

        while self.done < settings.generations:
            report(0.0)
            asked = [evolution.ask() for evolution in self.evolutions]
            costs, simulated = self._evaluate(np.concatenate(asked), lambda p: report(p.part))
            self._record(asked, costs.reshape(len(asked), settings.population, -1), simulated)
            self.done += 1
            self._save()
            report(0.0, complete=True)

    def _evaluate(self, points: FloatArray, progress: ProgressCallback) -> tuple[FloatArray, int]:
        """Return the costs of points, and how many had to be simulated: equal ones only once."""
        known = {
            point.tobytes(): cost
            for evolution in self.evolutions
            for point, cost in zip(evolution.points, evolution.costs, strict=True)
        }
        fresh = {key: point for point in points if (key := point.tobytes()) not in known}
        if fresh:
            controllers = [self.space.controller(self.space.values(p)) for p in fresh.values()]
            known |= zip(fresh, self.problem.costs_of(controllers, progress), strict=True)
        return np.array([known[point.tobytes()] for point in points]), len(fresh)

    def _record(self, asked: list[FloatArray], costs: FloatArray, simulated: int) -> None:
        diverged: BoolArray = np.logical_not(np.isfinite(costs).all(axis=2))
        nothing = np.flatnonzero(diverged.all(axis=1))
        if self.done == 0 and nothing.size:
            k = int(nothing[0])
            raise TuningError(
                f"generation 1, seed {self.settings.seeds[k]}: all {len(asked[k])} candidates "
                f"diverged, the first one {self._cause(asked[k][0])}; "
                "narrow the space, or start from a controller that holds the arm"
            )
        best, mean, parameters = [], [], []
        for evolution, told in zip(self.evolutions, costs, strict=True):
            evolution.tell(told)
            kept = evolution.costs
            best.append(kept.min(axis=0))
            finite = [column[np.isfinite(column)] for column in kept.T]
            mean.append([column.mean() if column.size else math.inf for column in finite])
            parameters.append(self.space.values(evolution.points[int(np.argmin(kept[:, 0]))]))
        rows = (best, mean, parameters, diverged.sum(axis=1), simulated)
        for name, row in zip(_RECORDS, rows, strict=True):
            self._records[name].append(np.array(row))

    def _cause(self, point: FloatArray) -> str:
        """Simulate one candidate that diverged and say how."""
        law = self.space.controller(self.space.values(point))
        outcomes = (simulate(e, law).outcome for e in self.problem.experiments)
        return next((str(o) for o in outcomes if not o.completed), "with a cost that is not finite")

    def summary(self) -> dict[str, Any]:
        """Return what any result has: the history, and how much was done for it."""
        records = {name: np.array(rows) for name, rows in self._records.items()}
        if len(self.problem.costs) == 1:
            records |= {name: records[name][..., 0] for name in ("best", "mean")}
        evaluations = self.settings.candidates * np.arange(1, self.done + 1)
        return {
            "history": History(
                tuple(self.settings.seeds), self.space.labels, **records, evaluations=evaluations
            ),
            "evaluations": int(evaluations[-1]),
            "simulations": int(records["simulated"].sum()) * len(self.problem.experiments),
        }


def _versions() -> dict[str, str]:
    """Return the versions of what decides a search's bits."""
    import pinocchio
    import pymoo

    modules = {"pin": pinocchio, "numpy": np, "pymoo": pymoo}
    return {"fpid_pin": __version__} | {k: str(m.__version__) for k, m in modules.items()}
