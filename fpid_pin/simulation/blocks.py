"""What the engine hands on: some consecutive rows of a run, and how it ended."""

from __future__ import annotations

from dataclasses import dataclass, field

from fpid_pin.checks import FloatArray

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


@dataclass(eq=False)
class Block:
    """Some consecutive rows of a run; views of buffers, valid until the next block.

    Attributes
    ----------
    first
        Row number of the first row.
    q_ref, v_ref, q, v, torque
        (K, n); torque is what the drives gave, after their limits.
    signals
        The controller's, by name, (K, n) or (K,).
    """

    first: int
    q_ref: FloatArray
    v_ref: FloatArray
    q: FloatArray
    v: FloatArray
    torque: FloatArray
    signals: dict[str, FloatArray] = field(default_factory=dict)
