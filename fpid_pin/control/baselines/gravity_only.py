"""No control at all but the weight: the lower end of every comparison."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


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

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        return state.gravity(q)
