"""PD control with gravity compensation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import check_gains, check_scale, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


@described("pd_gravity")
@dataclass(frozen=True, eq=False)
class PdGravity(Controller):
    """``u = s (Kp e + Kd e') + G(q)``, G of the nominal model at the measured pose.

    Globally asymptotically stable for set points on the exact model (Takegaki and Arimoto, ASME
    Journal of Dynamic Systems, Measurement, and Control 103, 1981; Siciliano et al., *Robotics*,
    2009, section 8.5.1). A wrong model leaves an offset.

    Parameters
    ----------
    kp, kd
        Scalar or (n,); N m/rad and N m s/rad, over the scale's unit where there is one.
    scale
        s: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    name
        What tables and figures call it.
    """

    kp: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    name: str = "PD + gravity"

    def __post_init__(self) -> None:
        check_gains(self, "kp", "kd")
        check_scale(self)

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _PdGravityState(cast("Sequence[PdGravity]", controllers), arm)


class _PdGravityState(State):
    def __init__(self, controllers: Sequence[PdGravity], arm: Arm) -> None:
        runs = len(controllers)
        self._fleet = Fleet([arm], runs)
        self._kp, self._kd = (stacked(controllers, k, arm, scaled=True) for k in ("kp", "kd"))
        self._saturation = Saturation(arm.effort_limit, runs)
        self._term, self._torque = (np.zeros((runs, arm.n)) for _ in range(2))

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        term, torque = self._term, self._torque
        self._fleet.gravity(q, torque)
        np.subtract(q_ref, q, out=term)
        term *= self._kp
        torque += term
        np.subtract(v_ref, v, out=term)
        term *= self._kd
        torque += term
        return self._saturation.apply(torque)
