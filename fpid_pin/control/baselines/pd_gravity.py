"""PD control with gravity compensation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin import checks
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
    2009, section 8.5.1). A wrong model leaves an offset, unless ``s Ki int e`` removes it or an
    observer does.

    Parameters
    ----------
    kp, kd
        Scalar or (n,) [N m/rad], [N m s/rad], over the scale's unit if any.
    scale
        Factor s: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    ki
        Of the integral [N m/(rad s)], likewise, held where the torque is cut; 0: none.
    observer
        Bandwidth [rad/s] of an observer of what the nominal model lacks, whose estimate is
        cancelled, as in `AdaptiveFpid`; 0: none.
    name
        What tables and figures call it.
    """

    kp: ArrayLike
    kd: ArrayLike
    scale: str | ArrayLike = "none"
    ki: ArrayLike = 0.0
    observer: float = 0.0
    name: str = "PD + gravity"

    def __post_init__(self) -> None:
        check_gains(self, "kp", "kd", "ki")
        object.__setattr__(self, "observer", checks.number("observer", self.observer, low=0.0))
        check_scale(self)

    def begin(self: Any, state: LawState) -> None:
        """Ask for the observer."""
        state.observe(self.observer)

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        e, e_dot = q_ref - q, v_ref - v
        terms = self.kp * e + self.kd * e_dot + self.ki * state.integral(e, e_dot)
        return self.scale * terms + state.gravity(q) - state.disturbance(q, v)
