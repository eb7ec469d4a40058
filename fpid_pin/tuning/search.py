"""The search itself: all seeds' populations in one call a generation, a checkpoint after each."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import TuningError
from fpid_pin.files import discard, kind_of, locked, require_file
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.tuning import checkpoint as files
from fpid_pin.tuning.evolution import Evolution
from fpid_pin.tuning.history import History
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.search_progress import Narrator, SearchCallback
from fpid_pin.tuning.settings import SearchSettings
from fpid_pin.tuning.space import BoundSpace

_RECORDS = ("best", "mean", "best_parameters", "diverged", "simulated")


class Search:
    """Evolutions of all seeds, side by side.

    Parameters
    ----------
    objective, space
        What to make small, and where to look.
    costs
        Number of costs.
    settings
        How.
    initial
        Points of every seed's first generation, (k, size).
    configuration
        All that decides the result, as a table: what a checkpoint must agree with.
    """

    def __init__(
        self,
        objective: Objective,
        space: BoundSpace,
        costs: int,
        settings: SearchSettings,
        *,
        initial: FloatArray,
        configuration: Mapping[str, Any],
    ) -> None:
        self._objective, self._costs = objective, costs
        self.space, self._settings = space, settings
        self._checkpoint = None if settings.checkpoint is None else Path(settings.checkpoint)
        self._configuration = files.plain(configuration)
        self.evolutions = [
            Evolution(
                space.size,
                costs,
                population=settings.population,
                crossover=settings.crossover,
                mutation=settings.mutation,
                seed=seed,
                initial=initial,
            )
            for seed in settings.seeds
        ]
        self.done = 0
        self.start_cost = float("inf")
        self._records: dict[str, list[Any]] = {name: [] for name in _RECORDS}

    # ------------------------------------------------------------------ checkpoints

    def alone(self) -> AbstractContextManager[None]:
        """Keep the checkpoint for a block: another search that wants it is refused."""
        return nullcontext() if self._checkpoint is None else locked(self._checkpoint)

    def prepare(self) -> None:
        """Take up the checkpoint, or write the first: what cannot be written fails here.

        Raises
        ------
        TuningError
            The checkpoint belongs to another search, or is there and may not be resumed.
        FileFormatError
            It is cut short or altered, or its folder cannot be written.
        """
        path = self._checkpoint
        if path is None:
            return
        require_file(path)
        # One without a generation holds nothing: it must not stand in the way of a search whose
        # configuration has been corrected since.
        if kind_of(path) is not None and not files.is_empty(path):
            if not self._settings.resume:
                raise TuningError(
                    f"{path}: there is a checkpoint of an earlier search: resume it, or remove it"
                )
            self._restore(path)
        self._save()

    def _save(self) -> None:
        if self._checkpoint is None:
            return
        arrays: dict[str, Any] = {}
        if self.done:
            states = [evolution.state() for evolution in self.evolutions]
            arrays |= {name: np.array([state[name] for state in states]) for name in states[0]}
            arrays |= {f"history_{name}": np.array(rows) for name, rows in self._records.items()}
        files.write(self._checkpoint, self.done, arrays, self._configuration)

    def _restore(self, path: Path) -> None:
        done, arrays = files.read(path, self._configuration)
        if done > self._settings.generations:
            raise TuningError(
                f"{path}: generations is {self._settings.generations} here, and {done} are done"
            )
        if done:
            for k, evolution in enumerate(self.evolutions):
                evolution.restore({name: array[k] for name, array in arrays.items()
                                   if not name.startswith("history_")})  # fmt: skip
            for name in _RECORDS:
                self._records[name] = list(arrays[f"history_{name}"])
        self.done = done

    # ------------------------------------------------------------------ generations

    def run(self, progress: SearchCallback | None) -> None:
        """Go on to the last generation.

        Raises
        ------
        TuningError
            Every candidate of a seed's first generation diverged; no checkpoint is left then.
        """
        settings = self._settings
        size = settings.population * len(settings.seeds)
        narrator = Narrator(progress, settings.generations, size, self.done)
        # By itself: a point of the unit cube gives it back to within rounding only.
        self.start_cost = float(self._objective.of([self.space.base])[0, 0])
        while self.done < settings.generations:
            generation, best = self.done + 1, self._best()
            narrator.tell(generation, 0.0, best=best)

            def told(inner: Progress, generation: int = generation, best: float = best) -> None:
                narrator.tell(generation, inner.part, best=best)

            asked = [evolution.ask() for evolution in self.evolutions]
            costs, simulated = self._evaluate(np.concatenate(asked), told)
            try:
                self._tell(asked, costs.reshape(len(asked), -1, self._costs), simulated)
            except TuningError:
                if self._checkpoint is not None:
                    discard(self._checkpoint)
                raise
            self.done = generation
            self._save()
            narrator.tell(generation, 1.0, best=self._best(), complete=True)

    def _best(self) -> float:
        return float(np.min(self._records["best"][-1][..., 0])) if self.done else np.inf

    @property
    def simulations(self) -> int:
        """Runs simulated so far."""
        return sum(int(row) for row in self._records["simulated"]) * self._objective.runs

    def _evaluate(self, points: FloatArray, progress: ProgressCallback) -> tuple[FloatArray, int]:
        """Return the costs of points, and how many had to be simulated.

        A point that is, to the last bit, one of a present population or of this generation would
        give the same cost again.
        """
        if not self._settings.reuse:
            return self._objective(points, progress), len(points)
        known: dict[bytes, FloatArray] = {}
        for evolution in self.evolutions:
            for point, cost in zip(evolution.points, evolution.costs, strict=True):
                known[point.tobytes()] = cost
        keys = [point.tobytes() for point in points]
        fresh = list(dict.fromkeys(key for key in keys if key not in known))
        if fresh:
            first = {key: k for k, key in reversed(list(enumerate(keys)))}
            rows = self._objective(points[[first[key] for key in fresh]], progress)
            known |= dict(zip(fresh, rows, strict=True))
        return np.array([known[key] for key in keys]), len(fresh)

    def _tell(self, asked: list[FloatArray], costs: FloatArray, simulated: int) -> None:
        best, mean, parameters, diverged = [], [], [], []
        for k, (evolution, told) in enumerate(zip(self.evolutions, costs, strict=True)):
            lost = ~np.isfinite(told).all(axis=1)
            if self.done == 0 and lost.all():
                raise TuningError(
                    f"generation 1, seed {self._settings.seeds[k]}: all {len(told)} candidates "
                    f"diverged, the first one {self._objective.cause(asked[k][0])}; "
                    "narrow the space, or start from a controller that holds the arm"
                )
            evolution.tell(told)
            kept = evolution.costs
            finite = np.isfinite(kept)
            best.append(kept.min(axis=0))
            mean.append(
                [
                    kept[finite[:, c], c].mean() if finite[:, c].any() else np.inf
                    for c in range(self._costs)
                ]
            )
            parameters.append(self.space.values(evolution.points[int(np.argmin(kept[:, 0]))]))
            diverged.append(int(lost.sum()))
        rows = (best, mean, parameters, diverged, simulated)
        for name, row in zip(_RECORDS, rows, strict=True):
            self._records[name].append(np.array(row))

    def history(self) -> History:
        """Return what has happened so far."""
        settings = self._settings
        best, mean = np.array(self._records["best"]), np.array(self._records["mean"])
        if self._costs == 1:
            best, mean = best[..., 0], mean[..., 0]
        size = settings.population * len(settings.seeds)
        return History(
            seeds=tuple(settings.seeds),
            labels=self.space.labels,
            best=best,
            mean=mean,
            best_parameters=np.array(self._records["best_parameters"]),
            diverged=np.array(self._records["diverged"], dtype=np.int64),
            simulated=np.array(self._records["simulated"], dtype=np.int64),
            evaluations=size * np.arange(1, self.done + 1),
        )
