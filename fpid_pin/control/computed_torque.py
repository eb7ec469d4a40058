"""Feedback linearisation on the nominal model: u*, eq. (8)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


@described("computed_torque")
@dataclass(frozen=True, eq=False)
class ComputedTorque(Controller):
    """u* of (8) with what is known of the arm: ``C q' + G + M (q''_d + k1 e' + k0 e)``.

    The unknown D is left out. On the exact model ``e'' + k1 e' + k0 e = 0``.

    Parameters
    ----------
    k0, k1
        [1/s^2] and [1/s], scalar or (n,).
    name
        What tables and figures call it.
    """

    k0: ArrayLike = 1.0
    k1: ArrayLike = 2.0
    name: str = "computed torque"

    def __post_init__(self) -> None:
        check_gains(self, "k0", "k1")

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """Return u* (8): see `Controller.torque`."""
        e, e_dot = q_ref - q, v_ref - v
        return state.inverse_dynamics(q, v, a_ref + self.k1 * e_dot + self.k0 * e)
