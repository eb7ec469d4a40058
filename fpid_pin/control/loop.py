"""A law on one robot, a tick at a time."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.record import ROWS, Record
from fpid_pin.exceptions import FpidWarning, SimulationError

if TYPE_CHECKING:
    from fpid_pin.control.state import State

_NAMES = ("q", "v", "q_ref", "v_ref", "a_ref")


class Loop:
    """A law on one robot: arrays of shape (n,) in, a fresh (n,) torque out, inputs checked.

    Parameters
    ----------
    state
        Of one robot.
    restart
        Makes a state as it was at the start, for `reset`.
    controller
        The law's description, for whoever records it.
    """

    def __init__(
        self, state: State, restart: Callable[[], State] | None = None, controller: Any = None
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels.limits import finite

        self.controller = controller
        self._restart = restart
        self._record: Record | None
        self._finite: Any = finite
        self._shape = (state.n,)
        self._rest = np.zeros(state.n)
        self._take_over(state)

    def _take_over(self, state: State) -> None:
        """Work on a state from its start."""
        state.prepare()
        self.state, self._ticks, self._record = state, 0, None
        self._rows, self._flat = tuple(state.inputs), state.inputs.reshape(-1)
        self._last = state.ticks_within_horizon

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
        if not self._finite(self._flat):
            self._take(self._rows)
        if self._ticks == self._last > 0:
            self._warn()
        self._ticks += 1
        state.tick()
        torque: FloatArray = state.torque.copy()
        if self._record is not None:
            self._record.take(state.inputs, torque)
        return torque

    def _take(self, given: tuple[ArrayLike, ...]) -> None:
        """Copy the inputs, each of them checked."""
        arrays = [
            checks.vector(name, value, self.state.n)
            for name, value in zip(_NAMES, given, strict=True)
        ]
        for row, array in zip(self._rows, arrays, strict=True):
            row[:] = array

    def _warn(self) -> None:
        warnings.warn(
            f"the law runs past its horizon of {self.state.horizon:g} s, for which its fractional "
            "memories are fitted: give start() the time that it will run",
            FpidWarning,
            stacklevel=3,
        )

    def signals(self) -> dict[str, FloatArray]:
        """Return copies of the law's inner signals at the last tick, (n,) or scalars."""
        return {name: np.array(value) for name, value in self.state.signals().items()}

    def record(self, rows: int = ROWS) -> Record:
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

    def new_record(self, rows: int = ROWS) -> Record:
        """Return a record of this law that somebody else fills."""
        state, rows = self.state, checks.integer("rows", rows, low=1)
        return Record(state.arm, state.step, self.controller, state.signals(), rows)

    def reset(self) -> None:
        """Be as at the start: no integral, no memory, the gains as given. Not for within a tick.

        Raises
        ------
        SimulationError
            The loop was made of a state alone, not by ``controller.start``.
        """
        if self._restart is None:
            raise SimulationError("reset: expected a loop by controller.start, got a state's")
        self._take_over(self._restart())
