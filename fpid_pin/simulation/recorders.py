"""What the loop hands on, a block of rows at a time, and who can receive it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray

ALL_SIGNALS = ("*",)

#: Rows handed on at a time: enough that what Python does for a block does not count.
BLOCK_ROWS = 512


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


@dataclass(frozen=True, eq=False)
class Batch:
    """What is known of the runs of one lockstep call before their rows come.

    Attributes
    ----------
    runs, n, rows, step
        Numbers of runs, joints and planned rows; sampling period [s].
    limit
        Of the torque, the least of law's and drives', (runs, n) [N m]; NaN where it is not known.
    arm
        The nominal arm; None where nobody asks for it.
    """

    runs: int
    n: int
    rows: int
    step: float
    limit: FloatArray
    arm: Arm | None = None

    def applied(self, block: Block, run: int) -> int:
        """Return how many rows of a block are of `run` and had their torque applied.

        All but the last row of a completed run, which nothing followed.
        """
        return max(min(int(block.valid[run]), self.rows - 1 - block.first), 0)


@dataclass(eq=False)
class Block:
    """Some consecutive rows of all runs; views of the loop's buffers, valid until the next block.

    Attributes
    ----------
    first
        Row number of the first row.
    t
        (K,) [s].
    q_ref, v_ref, q, v, torque
        (K, runs, n); torque is what the drives gave, after their limits.
    signals
        The controller's, by name, (K, runs, n) or (K, runs).
    valid
        Rows from the block's start that belong to each run, (runs,); fewer than K where a run
        has diverged.
    """

    first: int
    t: FloatArray
    q_ref: FloatArray
    v_ref: FloatArray
    q: FloatArray
    v: FloatArray
    torque: FloatArray
    valid: np.ndarray[tuple[int], np.dtype[np.intp]]
    signals: dict[str, FloatArray] = field(default_factory=dict)


class Recorder(Protocol):
    """Receives the rows of a lockstep call: the full record, the metrics and costs are recorders.

    Attributes
    ----------
    wanted
        Names of the controller's signals to be recorded; `ALL_SIGNALS` for all it has.
    """

    wanted: Sequence[str]

    def start(self, batch: Batch) -> None:
        """Prepare for the rows of `batch`."""
        ...

    def take(self, block: Block) -> None:
        """Take the next rows."""
        ...


class FullRecord:
    """Every row of every signal: what a `Run` is made of."""

    wanted: Sequence[str] = ALL_SIGNALS

    def __init__(self) -> None:
        self.arrays: dict[str, FloatArray] = {}
        self._rows = 0

    def start(self, batch: Batch) -> None:
        """See `Recorder.start`."""
        self._rows = batch.rows

    def take(self, block: Block) -> None:
        """See `Recorder.take`."""
        rows = {name: getattr(block, name) for name in ("q_ref", "v_ref", "q", "v", "torque")}
        for name, array in (rows | block.signals).items():
            if name not in self.arrays:
                # Runs outermost: each Run then owns contiguous arrays.
                shape = (array.shape[1], self._rows, *array.shape[2:])
                self.arrays[name] = np.zeros(shape)
            stop = block.first + len(block.t)
            self.arrays[name][:, block.first : stop] = array.swapaxes(0, 1)
