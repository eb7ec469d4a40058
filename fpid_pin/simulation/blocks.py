"""Words that the engine and its readers share: names of arrays, rows at a time, how a run ended."""

from __future__ import annotations

from dataclasses import dataclass

#: Arrays of the motion of every run, (N, n) each.
MOTION = ("q", "v", "q_ref", "v_ref", "torque")
#: Rows handed on at a time: enough that what Python does for a block does not count.
BLOCK_ROWS = 4096


@dataclass(frozen=True)
class Outcome:
    """How a run ended.

    Parameters
    ----------
    completed
        Whether it reached its duration.
    time
        When it ended [s].
    joint, cause
        Which joint ended it (none where it was the law itself), and why; empty where it completed.
    """

    completed: bool
    time: float
    joint: str = ""
    cause: str = ""

    def __str__(self) -> str:
        if self.completed:
            return f"completed at {self.time:g} s"
        if not self.joint:
            return f"ended at {self.time:g} s: {self.cause}"
        return f"diverged at {self.time:g} s, {self.joint}: {self.cause}"
