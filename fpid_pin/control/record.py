"""What a loop sees and does, tick by tick."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Rows that there is room for where nobody says: 16 s at 1 kHz.
ROWS = 16_384


class Record:
    """Rows of one robot, for `Run.from_record`; there is always room, doubled where it is full.

    Attributes
    ----------
    arm, controller
        The nominal arm, and the law's description where it is known.
    step
        Sampling period [s].

    Parameters
    ----------
    live
        The law's signals: views, which are looked at in every row.
    rows
        That there is room for at first.
    """

    def __init__(
        self, arm: Arm, step: float, controller: Any, live: Mapping[str, FloatArray], rows: int
    ) -> None:
        self.arm, self.step, self.controller = arm, step, controller
        self._count, self._live = 0, dict(live)
        self._motion: FloatArray = np.zeros((rows, 5, arm.n))
        self._kept = {name: np.zeros((rows, *np.shape(value))) for name, value in live.items()}

    def __len__(self) -> int:
        return self._count

    def __repr__(self) -> str:
        return f"<Record of {self._count} rows, {self.step:g} s apart>"

    def take(self, inputs: FloatArray, torque: FloatArray) -> None:
        """Add a row.

        Parameters
        ----------
        inputs
            q, v, and the reference's q, v, a, (5, n).
        torque
            From this tick to the next, (n,) [N m].
        """
        k = self._count
        if k == len(self._motion):
            self._grow()
        row = self._motion[k]
        row[:4] = inputs[:4]
        row[4] = torque
        for name, value in self._live.items():
            self._kept[name][k] = value
        self._count = k + 1

    def _grow(self) -> None:
        self._motion = np.concatenate([self._motion, np.zeros_like(self._motion)])
        self._kept = {n: np.concatenate([a, np.zeros_like(a)]) for n, a in self._kept.items()}

    def arrays(self) -> dict[str, FloatArray]:
        """Return copies of t, (N,) [s], and of q, v, q_ref, v_ref and torque, (N, n)."""
        count = self._count
        names = ("q", "v", "q_ref", "v_ref", "torque")
        table = {name: self._motion[:count, k].copy() for k, name in enumerate(names)}
        return {"t": self.step * np.arange(count, dtype=np.float64)} | table

    def signals(self) -> dict[str, FloatArray]:
        """Return copies of what the law showed of itself, (N, n) or (N,)."""
        return {name: array[: self._count].copy() for name, array in self._kept.items()}
