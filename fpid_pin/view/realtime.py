"""Keeping a period: a tick every step, and an account of how well it was kept."""

from __future__ import annotations

import contextlib
import gc
import math
import os
import time
from array import array
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

# Sleep until this much before a tick, then spin: the scheduler wakes us some 0.1 ms late.
_SPIN = 2.5e-4
# Further behind than this (a suspended laptop) the schedule starts anew.
_GIVE_UP = 0.1


@dataclass(eq=False)
class Timing:
    """How a period was kept.

    Attributes
    ----------
    step
        The period [s].
    late
        How late each tick began [s].
    missed
        Ticks whose work was done later than one step after they were due.
    restarts
        How often the schedule was given up and begun anew.
    """

    step: float
    late: array[float] = field(default_factory=lambda: array("f"))
    missed: int = 0
    restarts: int = 0

    @property
    def ticks(self) -> int:
        """How many there were."""
        return len(self.late)

    @property
    def worst(self) -> float:
        """Largest lateness [s]."""
        return max(self.late, default=0.0)

    def lateness(self, percentile: float) -> float:
        """Return a percentile of how late ticks began [s]; NaN before any."""
        return float(np.percentile(self.late, percentile)) if self.late else math.nan

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
            timing.late.append(now - due)
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
