"""The classical PID of each joint by itself, gains fixed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin.control.law import Controller
from fpid_pin.control.parameters import check_gains
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

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    name: str = field(default="PID", kw_only=True)

    @staticmethod
    def torque(c: Any) -> Any:
        """Return u over the scale."""
        return c.kp * c.e + c.ki * c.int_e + c.kd * c.e_dot

    def __post_init__(self) -> None:
        self.check_options()
        check_gains(self, "kp", "ki", "kd")
