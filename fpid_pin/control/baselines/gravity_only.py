"""No control at all but the weight: the lower end of every comparison."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@described("none")
@dataclass(frozen=True, eq=False)
class GravityOnly(Controller):
    """``u = G(q)`` of the nominal model: "none" in tables.

    Parameters
    ----------
    name
        What tables and figures call it.
    """

    name: str = "none (gravity only)"

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _GravityState(len(controllers), arm)


class _GravityState(State):
    def __init__(self, runs: int, arm: Arm) -> None:
        self._fleet = Fleet([arm], runs)
        self._saturation = Saturation(arm.effort_limit, runs)
        self._torque = np.zeros((runs, arm.n))

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        self._fleet.gravity(q, self._torque)
        return self._saturation.apply(self._torque)
