"""Feedback linearisation on the nominal model: u*, eq. (8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains
from fpid_pin.control.state import LawState
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
    observer
        Bandwidth [rad/s] of an observer of what the nominal model lacks, whose estimate is
        cancelled, as in `AdaptiveFpid`; 0: none.
    name
        What tables and figures call it.
    """

    k0: ArrayLike = 1.0
    k1: ArrayLike = 2.0
    ki: ArrayLike = 0.0
    observer: float = 0.0
    name: str = "computed torque"

    def __post_init__(self) -> None:
        check_gains(self, "k0", "k1", "ki")
        object.__setattr__(self, "observer", checks.number("observer", self.observer, low=0.0))

    def begin(self: Any, state: LawState) -> None:
        """Ask for the observer."""
        state.observe(self.observer)

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """Return u* (8): see `Controller.torque`."""
        e, e_dot = q_ref - q, v_ref - v
        demand = a_ref + self.k1 * e_dot + self.k0 * e + self.ki * state.integral(e, e_dot)
        lost = state.disturbance(q, v)
        return state.inverse_dynamics(q, v, demand) - lost
