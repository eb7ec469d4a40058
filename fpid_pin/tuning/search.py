"""The search itself: all seeds' populations in one call a generation, a checkpoint after each."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FileFormatError, TuningError
from fpid_pin.tuning import checkpoint as files
from fpid_pin.tuning.evolution import Evolution
from fpid_pin.tuning.history import History, Report
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.settings import Settings
from fpid_pin.tuning.space import BoundSpace

Progress = Callable[[Report], None]
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
    checkpoint
        File written after every generation; None: none.
    """

    def __init__(
        self,
        objective: Objective,
        space: BoundSpace,
        costs: int,
        settings: Settings,
        *,
        initial: FloatArray,
        configuration: Mapping[str, Any],
        checkpoint: Path | None,
    ) -> None:
        self._objective, self._space, self._costs = objective, space, costs
        self._settings, self._checkpoint = settings, checkpoint
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
        self._records: dict[str, list[Any]] = {name: [] for name in _RECORDS}

    # ------------------------------------------------------------------ checkpoints

    def prepare(self, resume: bool) -> None:
        """Take up the checkpoint, or write the first: what cannot be written fails here.

        Raises
        ------
        TuningError
            The checkpoint belongs to another search, or is there and `resume` was not asked for.
        FileFormatError
            It is cut short or altered, or its folder cannot be written.
        """
        path = self._checkpoint
        if path is None:
            if resume:
                raise ArgumentError("resume", "a checkpoint to resume from", "none")
            return
        if path.exists():
            if not resume:
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
            for k, evolution in enumerate(self.evolutions):
                arrays |= {f"seed{k}_{name}": value for name, value in evolution.state().items()}
            arrays |= {f"history_{name}": np.array(rows) for name, rows in self._records.items()}
        meta = {"configuration": self._configuration, "done": self.done}
        files.write(self._checkpoint, arrays, meta)

    def _restore(self, path: Path) -> None:
        arrays, meta = files.read(path)
        files.agree(path, meta, self._configuration)
        done = int(meta["done"])
        if done > self._settings.generations:
            raise TuningError(
                f"{path}: generations is {self._settings.generations} here, and {done} are done"
            )
        if done:
            try:
                for k, evolution in enumerate(self.evolutions):
                    mark = f"seed{k}_"
                    state = {
                        name.removeprefix(mark): array
                        for name, array in arrays.items()
                        if name.startswith(mark)
                    }
                    evolution.restore(state)
                for name in _RECORDS:
                    self._records[name] = list(arrays[f"history_{name}"])
            except (KeyError, ValueError) as error:
                raise FileFormatError(
                    f"{path}: expected a whole checkpoint, got {error!r}"
                ) from None
        self.done = done

    # ------------------------------------------------------------------ generations

    def run(self, progress: Progress | None) -> None:
        """Go on to the last generation.

        Raises
        ------
        TuningError
            Every candidate of a seed's first generation diverged.
        """
        settings = self._settings
        size = settings.population * len(settings.seeds)
        began, before = time.monotonic(), self.done

        def report(generation: int, part: float) -> None:
            if progress is None:
                return
            seconds = time.monotonic() - began
            here = (generation - 1 - before + part) * size
            rate = here / seconds if seconds > 0.0 else 0.0
            left = (settings.generations - generation + 1 - part) * size
            best = float(np.min(self._records["best"][-1][..., 0])) if self.done else np.inf
            progress(
                Report(
                    part=(generation - 1 + part) / settings.generations,
                    generation=generation,
                    generations=settings.generations,
                    complete=self.done == generation,
                    best=best,
                    evaluations=round((generation - 1 + part) * size),
                    rate=rate,
                    seconds_left=left / rate if rate > 0.0 else np.nan,
                )
            )

        while self.done < settings.generations:
            generation = self.done + 1
            report(generation, 0.0)
            asked = [evolution.ask() for evolution in self.evolutions]
            costs, simulated = self._evaluate(np.concatenate(asked), partial(report, generation))
            self._tell(asked, costs.reshape(len(asked), -1, self._costs), simulated)
            self.done = generation
            self._save()
            report(generation, 1.0)

    def _evaluate(
        self, points: FloatArray, progress: Callable[[float], None]
    ) -> tuple[FloatArray, int]:
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
            parameters.append(self._space.values(evolution.points[int(np.argmin(kept[:, 0]))]))
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
            seeds=settings.seeds,
            labels=self._space.labels,
            best=best,
            mean=mean,
            best_parameters=np.array(self._records["best_parameters"]),
            diverged=np.array(self._records["diverged"], dtype=np.int64),
            simulated=np.array(self._records["simulated"], dtype=np.int64),
            evaluations=size * np.arange(1, self.done + 1),
        )
