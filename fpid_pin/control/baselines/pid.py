"""The classical PID of each joint by itself, gains fixed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains, check_scale
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


@described("pid")
@dataclass(frozen=True, eq=False)
class Pid(Controller):
    """``u = s (Kp e + Ki int e + Kd e')``, joint by joint, without a model.

    The integral is held while a joint's torque is cut and integrating on would ask for more
    (conditional integration: Åström and Hägglund, *Advanced PID Control*, 2006, section 3.5).

    Parameters
    ----------
    kp, ki, kd
        Scalar or (n,) [N m/rad], [N m/(rad s)], [N m s/rad], over the scale's unit if any.
    scale
        Factor s: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
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

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        e, e_dot = q_ref - q, v_ref - v
        return self.scale * (self.kp * e + self.ki * state.integral(e, e_dot) + self.kd * e_dot)
