"""PD control with gravity compensation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains, check_scale
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


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
        Scalar or (n,) [N m/rad], [N m s/rad], over the scale's unit if any.
    scale
        Factor s: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
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

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        return self.scale * (self.kp * (q_ref - q) + self.kd * (v_ref - v)) + state.gravity(q)
