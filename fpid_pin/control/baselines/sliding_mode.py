"""Sliding-mode control with a boundary layer, on the nominal model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains, check_scale
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


@described("sliding_mode")
@dataclass(frozen=True, eq=False)
class SlidingMode(Controller):
    """``u = M v'_r + C v_r + G - s_j K sat(S/layer)`` on the surface S = q' - v_r.

    v_r = q'_d + slope e is the reference velocity; M, C and G are the nominal model's. With
    1/2 S^T M S as the Lyapunov function, S reaches the layer in finite time wherever the torque
    s_j K exceeds what the model leaves out; inside it the error is of the layer's width over the
    slope (Slotine and Sastry, International Journal of Control 38, 1983; Slotine and Li, *Applied
    Nonlinear Control*, 1991, sections 7.2 and 9.2).

    Parameters
    ----------
    slope
        [1/s], scalar or (n,).
    gain
        K [N m] over the scale's unit (so [1/s^2] with ``"inertia"``), scalar or (n,).
    boundary_layer
        [rad/s], scalar or (n,); 0 switches, and chatters in a sampled loop.
    scale
        Factor s_j: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    observer
        Bandwidth [rad/s] of an observer of what the nominal model lacks, whose estimate is
        cancelled, as in `AdaptiveFpid`; 0: none.
    name
        What tables and figures call it.
    """

    slope: ArrayLike
    gain: ArrayLike
    boundary_layer: ArrayLike = 0.1
    scale: str | ArrayLike = "none"
    observer: float = 0.0
    name: str = "sliding mode"

    def __post_init__(self) -> None:
        check_gains(self, "slope", "gain", "boundary_layer")
        object.__setattr__(self, "observer", checks.number("observer", self.observer, low=0.0))
        check_scale(self)

    def begin(self: Any, state: LawState) -> None:
        """Show S; ask for the observer."""
        state.observe(self.observer)
        state.shown["s"] = np.zeros_like(state.torque)

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        v_r = v_ref + self.slope * (q_ref - q)
        a_r = a_ref + self.slope * (v_ref - v)
        s = v - v_r
        state.shown["s"][:] = s
        # C(q, v) w is bilinear and symmetric: c((v + w)/2) - c((v - w)/2) with c(x) = C(q, x) x.
        model = state.inverse_dynamics(q, 0.5 * (v + v_r), a_r) - state.coriolis(q, 0.5 * s)
        # Without a layer the ramp is so steep that only its ends are left.
        ramp = np.clip(s / np.maximum(self.boundary_layer, 1e-300), -1.0, 1.0)
        lost = state.disturbance(q, v)
        return model - self.scale * self.gain * ramp - lost
