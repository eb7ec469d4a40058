"""The search itself: all seeds' populations in one call a generation, a checkpoint after each."""

from __future__ import annotations

import json
import math
import re
import time
import warnings
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import npz
from fpid_pin._version import __version__
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.exceptions import FpidWarning, TuningError
from fpid_pin.files import kind_of, locked, require_file
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import simulate
from fpid_pin.text import differences, listed
from fpid_pin.tuning.evolution import Evolution
from fpid_pin.tuning.results import History
from fpid_pin.tuning.robust import Objective
from fpid_pin.tuning.settings import SearchCallback, SearchProgress, SearchSettings
from fpid_pin.tuning.space import BoundSpace

_RECORDS = ("best", "mean", "best_parameters", "diverged", "simulated")


def versions() -> dict[str, str]:
    """Return the versions of what decides a search's bits."""
    import pinocchio
    import pymoo

    modules = {"pin": pinocchio, "numpy": np, "pymoo": pymoo}
    return {"fpid_pin": __version__} | {k: str(m.__version__) for k, m in modules.items()}


class Search:
    """Evolutions of all seeds, side by side.

    `initial`, (k, size), are points of every seed's first generation; `configuration` is all that
    decides the result, as a table: what a checkpoint must agree with.
    """

    def __init__(
        self,
        objective: Objective,
        space: BoundSpace,
        settings: SearchSettings,
        *,
        initial: FloatArray,
        configuration: Mapping[str, Any],
    ) -> None:
        self._objective, self.space, self._settings = objective, space, settings
        self._checkpoint = None if settings.checkpoint is None else Path(settings.checkpoint)
        # As it is read back from a file. Objects of a user's own appear as their repr; its address
        # changes from process to process.
        text = re.sub(r" at 0x[0-9a-fA-F]+", "", json.dumps(configuration))
        self._configuration = json.loads(text)
        self.evolutions = [
            Evolution(
                initial, len(objective.costs), population=settings.population,
                crossover=settings.crossover, mutation=settings.mutation, seed=seed,
            )
            for seed in settings.seeds
        ]  # fmt: skip
        self.done = 0
        self.start_cost = math.inf
        self._records: dict[str, list[Any]] = {name: [] for name in _RECORDS}

    # ------------------------------------------------------------------ checkpoints

    def alone(self) -> AbstractContextManager[None]:
        """Keep the checkpoint for a block: another search that wants it is refused."""
        return nullcontext() if self._checkpoint is None else locked(self._checkpoint)

    def take_up(self) -> None:
        """Go on from the checkpoint, where there is one; refuse another search's."""
        path, settings = self._checkpoint, self._settings
        if path is None:
            return
        require_file(path)
        if kind_of(path) is None:
            return
        if not settings.resume:
            raise TuningError(
                f"{path}: there is a checkpoint of an earlier search: resume it, or remove it"
            )
        arrays, table = npz.read(path, "checkpoint")
        found = differences(table["configuration"], self._configuration)
        if found:
            raise TuningError(f"{path}: a checkpoint of another search: {listed(found, str)}")
        if table["done"] > settings.generations:
            raise TuningError(
                f"{path}: generations is {settings.generations} here, and {table['done']} are done"
            )
        found = differences(table["versions"], versions())
        if found:
            warnings.warn(
                f"{path}: written with other versions, so the last bits may differ: "
                + "; ".join(found),
                FpidWarning,
                stacklevel=3,
            )
        self.done = table["done"]
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
        table = {
            "configuration": self._configuration, "done": self.done, "versions": versions(),
        }  # fmt: skip
        npz.write(self._checkpoint, "checkpoint", table, arrays)

    # ------------------------------------------------------------------ generations

    def run(self, progress: SearchCallback | None) -> None:
        """Go on to the last generation."""
        settings, before, began = self._settings, self.done, time.monotonic()
        # By itself: a point of the unit cube gives it back to within rounding only.
        self.start_cost = float(self._objective([self.space.base])[0, 0])

        def tell(part: float, complete: bool = False) -> None:
            if progress is None:
                return
            done, all_ = self.done + part, settings.generations
            seconds = max(time.monotonic() - began, 1e-9)
            rate = (done - before) * settings.candidates / seconds
            left = (all_ - done) * settings.candidates / rate if rate > 0.0 else math.nan
            progress(SearchProgress(
                done / all_, self.done + (not complete), all_, complete, self._best(),
                round(done * settings.candidates), rate, left,
            ))  # fmt: skip

        while self.done < settings.generations:
            tell(0.0)
            asked = [evolution.ask() for evolution in self.evolutions]
            costs, simulated = self._evaluate(np.concatenate(asked), lambda p: tell(p.part))
            self._tell(asked, costs.reshape(len(asked), settings.population, -1), simulated)
            self.done += 1
            self._save()
            tell(0.0, complete=True)

    def _best(self) -> float:
        return float(np.min(self._records["best"][-1][..., 0])) if self.done else math.inf

    @property
    def simulations(self) -> int:
        """Runs simulated so far."""
        return sum(map(int, self._records["simulated"])) * len(self._objective.experiments)

    def _evaluate(self, points: FloatArray, progress: ProgressCallback) -> tuple[FloatArray, int]:
        """Return the costs of points, and how many had to be simulated: equal ones only once."""
        known: dict[bytes, FloatArray] = {}
        for evolution in self.evolutions:
            for point, cost in zip(evolution.points, evolution.costs, strict=True):
                known[point.tobytes()] = cost
        fresh = {point.tobytes(): point for point in points}
        fresh = {key: point for key, point in fresh.items() if key not in known}
        if fresh:
            controllers = [self.space.controller(point) for point in fresh.values()]
            known |= zip(fresh, self._objective(controllers, progress), strict=True)
        return np.array([known[point.tobytes()] for point in points]), len(fresh)

    def _tell(self, asked: list[FloatArray], costs: FloatArray, simulated: int) -> None:
        lost: BoolArray = np.logical_not(np.isfinite(costs).all(axis=2))
        nothing = np.flatnonzero(lost.sum(axis=1) == lost.shape[1])
        if self.done == 0 and nothing.size:
            k = int(nothing[0])
            raise TuningError(
                f"generation 1, seed {self._settings.seeds[k]}: all {lost.shape[1]} candidates "
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
        rows = (best, mean, parameters, lost.sum(axis=1), simulated)
        for name, row in zip(_RECORDS, rows, strict=True):
            self._records[name].append(np.array(row))

    def _cause(self, point: FloatArray) -> str:
        """Simulate one candidate that diverged and say how."""
        law = self.space.controller(point)
        outcomes = (simulate(e, law).outcome for e in self._objective.experiments)
        return next((str(o) for o in outcomes if not o.completed), "with a cost that is not finite")

    def history(self) -> History:
        """Return what has happened so far."""
        records = {name: np.array(rows) for name, rows in self._records.items()}
        if len(self._objective.costs) == 1:
            records |= {name: records[name][..., 0] for name in ("best", "mean")}
        return History(
            seeds=tuple(self._settings.seeds), labels=self.space.labels, **records,
            evaluations=self._settings.candidates * np.arange(1, self.done + 1),
        )  # fmt: skip
