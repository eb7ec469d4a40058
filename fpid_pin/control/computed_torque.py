"""Feedback linearisation on the nominal model: u*, eq. (8)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import check_gains, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@described("computed_torque")
@dataclass(frozen=True, eq=False)
class ComputedTorque(Controller):
    """u* of (8) with what is known of the arm: ``C q' + G + M (q''_d + k1 e' + k0 e)``.

    The unknown D is left out. On the exact model ``e'' + k1 e' + k0 e = 0``.

    Parameters
    ----------
    k0, k1
        1/s^2 and 1/s, scalar or (n,).
    name
        What tables and figures call it.
    """

    k0: ArrayLike = 1.0
    k1: ArrayLike = 2.0
    name: str = "computed torque"

    def __post_init__(self) -> None:
        check_gains(self, "k0", "k1")

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _ComputedTorqueState(cast("Sequence[ComputedTorque]", controllers), arm)


class _ComputedTorqueState(State):
    def __init__(self, controllers: Sequence[ComputedTorque], arm: Arm) -> None:
        runs, n = len(controllers), arm.n
        self._fleet = Fleet([arm], runs)
        self._k0, self._k1 = (stacked(controllers, name, arm) for name in ("k0", "k1"))
        self._saturation = Saturation(arm.effort_limit, runs)
        self._a, self._work, self._torque = (np.zeros((runs, n)) for _ in range(3))

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        a, work = self._a, self._work
        np.subtract(q_ref, q, out=a)
        a *= self._k0
        np.subtract(v_ref, v, out=work)
        work *= self._k1
        a += work
        a += a_ref
        self._fleet.inverse_dynamics(q, v, a, self._torque)
        return self._saturation.apply(self._torque)
