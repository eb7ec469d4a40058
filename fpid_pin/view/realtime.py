"""Keeping a period: a tick every step, and an account of how well it was kept."""

from __future__ import annotations

import contextlib
import gc
import math
import os
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

# Sleep until this much before a tick, then spin: the scheduler wakes us some 0.1 ms late.
_SPIN = 2.5e-4
# Further behind than this (a suspended laptop) the schedule starts anew.
_GIVE_UP = 0.1
_BIN = 1e-6
_BINS = 100_000


@dataclass(eq=False)
class Timing:
    """How a period was kept; memory does not grow with the number of ticks.

    Attributes
    ----------
    step
        The period [s].
    ticks
        Ticks made.
    missed
        Ticks whose work was done later than one step after they were due.
    restarts
        How often the schedule was given up and begun anew.
    worst
        Largest lateness [s].
    """

    step: float
    ticks: int = 0
    missed: int = 0
    restarts: int = 0
    worst: float = 0.0
    _counts: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_BINS + 1, dtype=np.int64))

    def note(self, late: float) -> None:
        """Count a tick that began `late` [s] after it was due."""
        self.ticks += 1
        self.worst = max(self.worst, late)
        self._counts[min(max(int(late / _BIN), 0), _BINS)] += 1

    def lateness(self, percentile: float) -> float:
        """Return a percentile of how late ticks began [s], to a microsecond; NaN before any."""
        if not self.ticks:
            return math.nan
        rank = math.ceil(percentile / 100.0 * self.ticks)
        index = int(np.searchsorted(np.cumsum(self._counts), max(rank, 1)))
        return self.worst if index == _BINS else min((index + 1) * _BIN, self.worst)

    def __str__(self) -> str:
        part = 100.0 * self.missed / self.ticks if self.ticks else 0.0
        late = ", ".join(
            f"{name} {1e6 * self.lateness(p):.0f} us"
            for name, p in (("median", 50.0), ("99th", 99.0), ("99.9th percentile", 99.9))
        )
        return (
            f"{self.ticks} ticks of {1e3 * self.step:g} ms, {self.missed} deadlines missed "
            f"({part:.3g} %); lateness: {late}, worst {1e6 * self.worst:.0f} us"
        )


def keep_time(
    tick: Callable[[], bool], step: float, *, idle: Callable[[], bool], every: float
) -> Timing:
    """Call `tick` every `step` [s] until it or `idle` returns False; Ctrl-C ends it too.

    Parameters
    ----------
    tick
        The work of a period.
    step
        The period [s].
    idle
        Called right after a tick, once every so often, for what is not urgent; ticks are due when
        they are due whether or not this has ended.
    every
        How often that is [s].

    Notes
    -----
    Sleeps, then spins for the last quarter of a millisecond. The garbage collector waits.
    """
    timing = Timing(step)
    collecting = gc.isenabled()
    try:
        gc.collect()
        gc.disable()
        due = time.perf_counter() + step
        idle_due = due
        while True:
            left = due - time.perf_counter() - _SPIN
            if left > 0.0:
                time.sleep(left)
            while (now := time.perf_counter()) < due:
                pass
            timing.note(now - due)
            going = tick()
            end = time.perf_counter()
            if end > due + step:
                timing.missed += 1
            if not going:
                break
            if end >= idle_due:
                if not idle():
                    break
                idle_due = max(idle_due + every, end)
            due += step
            if time.perf_counter() - due > _GIVE_UP:
                timing.restarts += 1
                due = time.perf_counter() + step
    except KeyboardInterrupt:
        pass
    finally:
        if collecting:
            gc.enable()
    return timing


@contextlib.contextmanager
def urgent() -> Iterator[bool]:
    """Ask the system to run this process before others while the block lasts.

    Yields whether it does: that takes a system with real-time scheduling, and its permission.
    """
    try:
        # Processes that we start meanwhile stay ordinary.
        policy = os.SCHED_FIFO | os.SCHED_RESET_ON_FORK
        os.sched_setscheduler(0, policy, os.sched_param(10))
    except (OSError, AttributeError):
        yield False
        return
    try:
        yield True
    finally:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
