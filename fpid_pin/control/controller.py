"""What a controller is: a frozen description, the state that runs it, and a one-robot loop."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Hashable, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


_INPUTS = ("q", "v", "q_ref", "v_ref", "a_ref")


class Controller(ABC):
    """A control law and its parameters for one robot.

    Subclasses are frozen dataclasses with read-only arrays; scalars hold for every joint. What
    changes while a law runs is its `State`.
    """

    def start(self, arm: Arm, *, step: float, horizon: float = 3600.0) -> Loop:
        """Start the law for one robot: a tick at a time, for any simulator or a real arm.

        Parameters
        ----------
        arm
            The nominal arm: its number of joints, model and effort limits.
        step
            Sampling period, s.
        horizon
            Longest time that the loop will run, s; fractional memories are fitted for it.

        Returns
        -------
        Loop
        """
        state = self.start_many([self], arm, step=step, horizon=horizon)
        return Loop(state, arm.n)

    @classmethod
    @abstractmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start one state that advances all `controllers` in lockstep, run i with controller i."""

    def lockstep_key(self) -> Hashable:
        """Return what two controllers must share to be advanced by one state."""
        return (type(self),)


class State(ABC):
    """All that changes while a law runs, in arrays of shape (runs, n)."""

    @abstractmethod
    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """Advance by one tick and return the torque, saturated, (runs, n), N m.

        Parameters
        ----------
        q, v
            Measured joint angles (rad) and rates (rad/s), (runs, n).
        q_ref, v_ref, a_ref
            Reference angles, rates and accelerations, (runs, n).

        Returns
        -------
        ndarray
            The state's own buffer: it holds until the next tick.
        """

    def signals(self) -> Mapping[str, FloatArray]:
        """Return live views of what a record should hold beside the torque."""
        return {}

    def retire(self, run: int) -> None:  # noqa: B027 - a law without memory has nothing to do
        """Make a diverged run's rows exact zeros for good.

        Left alone they would decay into denormal numbers, on which arithmetic is some 16 times
        slower for the whole batch.
        """


class Loop:
    """A law on one robot: arrays of shape (n,) in, a fresh (n,) torque out, inputs checked.

    Parameters
    ----------
    state
        A state with one run.
    n
        Number of joints.
    """

    def __init__(self, state: State, n: int) -> None:
        self.state = state
        self._n = n
        self._inputs = np.zeros((5, 1, n))
        self._rest = np.zeros(n)

    def torque(
        self,
        q: ArrayLike,
        v: ArrayLike,
        q_ref: ArrayLike,
        v_ref: ArrayLike,
        a_ref: ArrayLike | None = None,
    ) -> FloatArray:
        """Advance by one tick and return the torque for this sampling period, (n,), N m.

        Parameters
        ----------
        q, v
            Measured joint angles, rad, and rates, rad/s, (n,).
        q_ref, v_ref, a_ref
            Reference; no `a_ref` means zero acceleration.

        Raises
        ------
        ArgumentError
            Wrong length, NaN or inf. The state is then as before the call.
        """
        rows, shape = self._inputs, (self._n,)
        given = (q, v, q_ref, v_ref, self._rest if a_ref is None else a_ref)
        for row, name, value in zip(rows, _INPUTS, given, strict=True):
            array = np.asarray(value)
            if array.shape != shape or array.dtype.kind not in "fiu":
                array = checks.vector(name, value, self._n)
            row[0] = array
        # One sum finds every NaN and inf, at a third of the cost of asking each number.
        if not math.isfinite(rows.sum()):
            for row, name in zip(rows, _INPUTS, strict=True):
                checks.vector(name, row[0], self._n)
        torque: FloatArray = self.state.torque(*rows)[0].copy()
        return torque

    def signals(self) -> dict[str, FloatArray]:
        """Return copies of the law's inner signals at the last tick, (n,) or scalars."""
        return {name: value[0].copy() for name, value in self.state.signals().items()}
