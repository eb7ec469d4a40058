"""Sliding-mode control with a boundary layer, on the nominal model."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar

from numpy.typing import ArrayLike

from fpid_pin.checks import PerJoint
from fpid_pin.control.law import Controller
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
    scale, observer, supervisor, name
        See `Controller`.
    """

    slope: Annotated[ArrayLike, PerJoint("1/s", low=0.0)]
    gain: Annotated[ArrayLike, PerJoint("N m", low=0.0)]
    boundary_layer: Annotated[ArrayLike, PerJoint("rad/s", low=0.0)] = 0.1
    name: str = field(default="sliding mode", kw_only=True)

    uses_model = True
    shown: ClassVar = {"s": "s"}

    @staticmethod
    def surface(c: Any) -> None:
        """Write v_r, its rate, and S."""
        c.w = c.v_ref + c.slope * c.e
        c.a = c.a_ref + c.slope * c.e_dot
        c.s = c.v - c.w

    @staticmethod
    def torque(c: Any) -> Any:
        """Return the switching torque over the scale."""
        # Without a layer the ramp is so steep that only its ends are left.
        ramp = c.s / max(c.boundary_layer, 1e-300)
        return -c.gain * min(max(ramp, -1.0), 1.0)
