"""The classical PID of each joint by itself, gains fixed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import check_gains, check_scale, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@described("pid")
@dataclass(frozen=True, eq=False)
class Pid(Controller):
    """``u = s (Kp e + Ki int e + Kd e')``, joint by joint, without a model.

    The integral is held while a joint's torque is cut and integrating on would ask for more
    (conditional integration: Åström and Hägglund, *Advanced PID Control*, 2006, section 3.5).

    Parameters
    ----------
    kp, ki, kd
        Scalar or (n,); N m/rad, N m/(rad s), N m s/rad, over the scale's unit where there is one.
    scale
        s: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    name
        What tables and figures call it.
    """

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "PID"

    def __post_init__(self) -> None:
        check_gains(self, "kp", "ki", "kd")
        check_scale(self)

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _PidState(cast("Sequence[Pid]", controllers), arm, step)


class _PidState(State):
    def __init__(self, controllers: Sequence[Pid], arm: Arm, step: float) -> None:
        runs = len(controllers)
        gains = (stacked(controllers, k, arm, scaled=True) for k in ("kp", "ki", "kd"))
        self._kp, self._ki, self._kd = gains
        self._saturation = Saturation(arm.effort_limit, runs)
        # int e += h (e + e_)/2 + h^2 (e'_ - e')/12: both e and its rate are known.
        self._half, self._twelfth = step / 2.0, step * step / 12.0
        shape = (runs, arm.n)
        self._e, self._e_dot, self._int_e, self._kept = (np.zeros(shape) for _ in range(4))
        self._term, self._torque = np.zeros(shape), np.zeros(shape)
        self._started = False

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        e, e_dot, term, torque = self._e, self._e_dot, self._term, self._torque
        np.subtract(q_ref, q, out=e)
        np.subtract(v_ref, v, out=e_dot)
        self._integrate()
        np.multiply(self._kp, e, out=torque)
        torque += np.multiply(self._ki, self._int_e, out=term)
        torque += np.multiply(self._kd, e_dot, out=term)
        return self._saturation.apply(torque)

    def _integrate(self) -> None:
        even = self._half * self._e
        odd = self._twelfth * self._e_dot
        if self._started:
            increment = even - odd + self._kept
            hold = self._saturation.winds_up(self._e)
            if hold is not None:
                increment[hold] = 0.0
            self._int_e += increment
        self._started = True
        np.add(even, odd, out=self._kept)

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        for array in (self._e, self._e_dot, self._int_e, self._kept, self._torque):
            array[run] = 0.0
