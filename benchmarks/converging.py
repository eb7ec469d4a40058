"""CMA-ES for `baselines.py`: several searches at once, until they no longer improve.

A *track* is one search: a seed and a place to start. All tracks of a family share each call of
the engine. A track ends when `PATIENCE` generations have not improved it by `GAIN`, or at
`LONGEST`. After every generation all of it is written to a file, and a search started again goes
on from there.
"""

from __future__ import annotations

import math
import pickle
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import qmc

from fpid_pin.files import replacing

SIZE = 12  # candidates in a generation
PATIENCE, GAIN = 12, 0.005
SHORTEST, LONGEST = 20, 120  # generations
SPREAD = 3  # generations that look around before, where nothing is known
INWARDS = 0.1  # from the walls of the unit cube
HUGE = 1e9


@dataclass
class Normal:
    """Random numbers that are this track's own."""

    rng: np.random.Generator

    def __call__(self, *shape: int) -> np.ndarray:
        return self.rng.standard_normal(shape)


@dataclass
class Track:
    """One search."""

    label: str
    seed: int
    size: int
    start: np.ndarray | None = None
    best: float = math.inf
    point: np.ndarray | None = None
    history: list[float] = field(default_factory=list)  # best so far, a generation each
    engine: object = None

    def __post_init__(self) -> None:
        self.rng = np.random.default_rng((self.seed, sum(map(ord, self.label))))
        self.around = qmc.LatinHypercube(self.size, rng=self.rng).random(SPREAD * SIZE)
        if self.start is not None:
            # From beside the walls: a law that lacks a parameter lies in a corner.
            self.begin(np.clip(self.start, INWARDS, 1.0 - INWARDS), 0.15)

    def begin(self, at: np.ndarray, sigma: float) -> None:
        """Start the engine."""
        import cma

        options = {
            "bounds": [0.0, 1.0], "popsize": SIZE, "seed": np.nan, "verbose": -9, "verb_log": 0,
            "randn": Normal(self.rng), "tolfun": 0.0,
            "tolx": 0.0, "tolfunhist": 0.0, "tolstagnation": 10**6, "tolflatfitness": 10**6,
        }  # fmt: skip
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.engine = cma.CMAEvolutionStrategy(at, sigma, options)

    @property
    def done(self) -> bool:
        """Whether it has converged, or been at it long enough."""
        h = self.history
        if len(h) < SHORTEST:
            return False
        return len(h) >= LONGEST or h[-1] > (1.0 - GAIN) * h[-1 - PATIENCE]

    def ask(self) -> np.ndarray:
        """Return the next candidates; among the first is the place where it starts."""
        if self.engine is None:
            k = SIZE * len(self.history)
            self.asked = self.around[k : k + SIZE]
            return self.asked
        self.asked = np.array(self.engine.ask())  # type: ignore[attr-defined]
        if not self.history:
            self.asked[0] = self.start
        return self.asked

    def tell(self, costs: np.ndarray) -> None:
        """Take their costs."""
        k = int(np.argmin(costs))
        if costs[k] < self.best:
            self.best, self.point = float(costs[k]), self.asked[k].copy()
        self.history.append(self.best)
        if self.engine is None:
            if len(self.history) == SPREAD:
                self.begin(self.asked[0] if self.point is None else self.point, 0.2)
            return
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            self.engine.tell(list(self.asked), list(np.minimum(costs, HUGE)))  # type: ignore[attr-defined]


def load(path: Path, fingerprint: str) -> list[Track] | None:
    """Return the tracks of a checkpoint, finished or not; None where there is none."""
    if not path.exists():
        return None
    known, tracks = pickle.loads(path.read_bytes())
    if known != fingerprint:
        raise SystemExit(f"{path}: a checkpoint of another search; remove it to start anew")
    return list(tracks)


Objective = Callable[[Sequence[tuple[int, np.ndarray]]], np.ndarray]


def converge(
    path: Path, fingerprint: str, fresh: Callable[[], list[Track]], cost: Objective, until: float
) -> list[Track] | None:
    """Search all tracks to their ends, or return None where time `until` comes first.

    `fresh` makes the tracks where there is no checkpoint, `cost` gives costs of (seed, point)
    pairs.
    """
    tracks = load(path, fingerprint) or fresh()
    while open_ := [track for track in tracks if not track.done]:
        if time.monotonic() > until:
            return None
        asked = [track.ask() for track in open_]
        pairs = [(t.seed, x) for t, points in zip(open_, asked, strict=True) for x in points]
        costs = cost(pairs)
        for k, track in enumerate(open_):
            track.tell(costs[k * SIZE : (k + 1) * SIZE])
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as temporary:
            Path(temporary).write_bytes(pickle.dumps((fingerprint, tracks)))
    return tracks
