"""A law on one robot, a tick at a time, and the record of what it sees and does."""

import warnings
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidWarning

if TYPE_CHECKING:
    from fpid_pin.control.state import State

#: What a tick is given, in the order of `State.inputs`.
INPUTS = ("q", "v", "q_ref", "v_ref", "a_ref")
#: Rows that there is room for where nobody says: 16 s at 1 kHz.
ROWS = 16_384


class Loop:
    """A law on one robot: arrays of shape (n,) in, a fresh (n,) torque out, inputs checked.

    `controller.start` makes one, of a function that starts the law anew; `state` is where it is.
    """

    def __init__(self, start: Callable[[], "State"], controller: Any) -> None:
        self.controller, self._start = controller, start
        self._record: Record | None
        self.reset()

    def reset(self) -> None:
        """Be as at the start: no integral, no memory, the gains as given. Not for within a tick."""
        self.state = state = self._start()
        state.prepare()
        self._ticks, self._record = 0, None
        # How many ticks the fractional memories are fitted for; 0: there are none.
        self._last = round(state.horizon / state.step) + 1 if state.orders.size else 0
        self._shape, self._rest = (state.n,), np.zeros(state.n)
        self._rows, self._flat = tuple(state.inputs), state.inputs.reshape(-1)
        self._zeros = np.zeros(self._flat.size)

    def torque(
        self,
        q: ArrayLike,
        v: ArrayLike,
        q_ref: ArrayLike,
        v_ref: ArrayLike,
        a_ref: ArrayLike | None = None,
    ) -> FloatArray:
        """Advance by one tick and return the torque for this sampling period, (n,) [N m].

        Parameters
        ----------
        q, v
            Measured joint angles [rad] and rates [rad/s], (n,). Angles are taken as they are: one
            that jumps by a turn is an error of a turn (see `RobotLoop`).
        q_ref, v_ref, a_ref
            Reference; no `a_ref` means zero acceleration.

        Raises
        ------
        ArgumentError
            Wrong length, NaN or inf. The state is then as before the call.
        SimulationError
            A law of one's own that raises, or returns something of another shape.
        """
        given = (q, v, q_ref, v_ref, self._rest if a_ref is None else a_ref)
        state = self.state
        for row, value in zip(self._rows, given, strict=True):
            # The checks of a well-made array take longer than the law; they are for the others.
            if type(value) is np.ndarray and value.shape == self._shape and value.dtype == float:
                row[:] = value
            else:
                self._take(given)
                break
        # What is not finite is NaN times 0.
        if self._flat.dot(self._zeros) != 0.0:
            self._take(self._rows)
        if self._ticks == self._last > 0:
            warnings.warn(
                f"the law runs past its horizon of {state.horizon:g} s, for which its fractional "
                "memories are fitted: give start() the time that it will run",
                FpidWarning,
                stacklevel=2,
            )
        self._ticks += 1
        state.tick()
        torque: FloatArray = state.torque.copy()
        if self._record is not None:
            self._record.take(state.inputs, torque)
        return torque

    def _take(self, given: tuple[ArrayLike, ...]) -> None:
        """Copy the inputs, once all of them are checked."""
        arrays = [checks.vector(*x, self.state.n) for x in zip(INPUTS, given, strict=True)]
        for row, array in zip(self._rows, arrays, strict=True):
            row[:] = array

    def signals(self) -> dict[str, FloatArray]:
        """Return copies of the law's inner signals at the last tick, (n,) or scalars."""
        return {name: np.array(value) for name, value in self.state.signals().items()}

    def record(self, rows: int = ROWS) -> "Record":
        """Keep every tick from now on, until the next `record` or `reset`.

        Parameters
        ----------
        rows
            So many are kept without a moment's wait for memory.

        Returns
        -------
        Record
            Which grows; ``Run.from_record`` makes a run of it at any time.
        """
        self._record = self.new_record(rows)
        return self._record

    def new_record(self, rows: int = ROWS) -> "Record":
        """Return a record of this law that somebody else fills."""
        state, rows = self.state, checks.integer("rows", rows, low=1)
        return Record(state.arm, state.step, self.controller, state.signals(), rows)


class Record:
    """Rows of one robot, for `Run.from_record`; there is always room, doubled where it is full.

    `Loop.record` makes one.

    Attributes
    ----------
    arm, controller
        The nominal arm, and the law's description where it is known.
    step
        Sampling period [s].
    """

    def __init__(
        self, arm: Arm, step: float, controller: Any, live: Mapping[str, FloatArray], rows: int
    ) -> None:
        self.arm, self.step, self.controller = arm, step, controller
        # The law's signals are views, which are looked at in every row.
        self._count, self._live = 0, dict(live)
        self._motion: FloatArray = np.zeros((rows, 5, arm.n))
        self._kept = {name: np.zeros((rows, *np.shape(value))) for name, value in live.items()}

    def __len__(self) -> int:
        return self._count

    def __repr__(self) -> str:
        return f"<Record of {self._count} rows, {self.step:g} s apart>"

    def take(self, inputs: FloatArray, torque: FloatArray) -> None:
        """Add a row: `inputs` as `State.inputs`, (5, n); the torque until the next, (n,) [N m]."""
        k = self._count
        if k == len(self._motion):
            self._motion = np.concatenate([self._motion, np.zeros_like(self._motion)])
            self._kept = {n: np.concatenate([a, np.zeros_like(a)]) for n, a in self._kept.items()}
        self._motion[k, :4], self._motion[k, 4] = inputs[:4], torque
        for name, value in self._live.items():
            self._kept[name][k] = value
        self._count = k + 1

    def arrays(self) -> dict[str, FloatArray]:
        """Return copies of t, (N,) [s], and of q, v, q_ref, v_ref and torque, (N, n)."""
        names = (*INPUTS[:4], "torque")
        table = {name: self._motion[: self._count, k].copy() for k, name in enumerate(names)}
        return {"t": self.step * np.arange(self._count, dtype=np.float64)} | table

    def signals(self) -> dict[str, FloatArray]:
        """Return copies of what the law showed of itself, (N, n) or (N,)."""
        return {name: array[: self._count].copy() for name, array in self._kept.items()}
