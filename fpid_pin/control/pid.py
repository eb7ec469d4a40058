"""The classical PID of each joint by itself, gains fixed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from numpy.typing import ArrayLike

from fpid_pin.checks import PerJoint
from fpid_pin.control.law import Controller
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
    scale, feedforward, observer, supervisor, name
        See `Controller`.
    """

    kp: Annotated[ArrayLike, PerJoint("N m/rad", low=0.0)]
    ki: Annotated[ArrayLike, PerJoint("N m/(rad s)", low=0.0)]
    kd: Annotated[ArrayLike, PerJoint("N m s/rad", low=0.0)]
    name: str = field(default="PID", kw_only=True)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return u over the scale."""
        return c.kp * c.e + c.ki * c.int_e + c.kd * c.e_dot
