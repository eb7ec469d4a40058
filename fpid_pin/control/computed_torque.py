"""Feedback linearisation on the nominal model: u*, eq. (8)."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any

from numpy.typing import ArrayLike

from fpid_pin.checks import PerJoint
from fpid_pin.control.law import Controller
from fpid_pin.descriptions import described


@described("computed_torque")
@dataclass(frozen=True, eq=False)
class ComputedTorque(Controller):
    """u* of (8) with what is known of the arm: ``C q' + G + M (q''_d + k1 e' + k0 e)``.

    The unknown D is left out. On the exact model ``e'' + k1 e' + k0 e = 0``. As people use it on
    arms that they know less well, with ``ki int e`` inside the bracket or an observer of D.

    Parameters
    ----------
    k0, k1
        [1/s^2] and [1/s], scalar or (n,).
    ki
        Of the integral [1/s^3], scalar or (n,), held where the torque is cut; 0: none.
    observer, supervisor, name
        See `Controller`.
    """

    k0: Annotated[ArrayLike, PerJoint("1/s^2", low=0.0)] = 1.0
    k1: Annotated[ArrayLike, PerJoint("1/s", low=0.0)] = 2.0
    ki: Annotated[ArrayLike, PerJoint("1/s^3", low=0.0)] = 0.0
    name: str = field(default="computed torque", kw_only=True)

    uses_model = True

    @staticmethod
    def surface(c: Any) -> None:
        """Write what the model is asked about: M a + C(q, q') q' + G."""
        c.a = c.a_ref + c.k1 * c.e_dot + c.k0 * c.e + c.ki * c.int_e
        c.w = c.v
