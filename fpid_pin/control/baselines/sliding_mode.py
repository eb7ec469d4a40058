"""Sliding-mode control with a boundary layer, on the nominal model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.arms.fleet import Fleet
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import check_gains, check_scale, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


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
        1/s, scalar or (n,).
    gain
        K, N m over the scale's unit (so 1/s^2 with ``"inertia"``), scalar or (n,).
    boundary_layer
        rad/s, scalar or (n,); 0 switches, and chatters in a sampled loop.
    scale
        s_j: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    name
        What tables and figures call it.
    """

    slope: ArrayLike
    gain: ArrayLike
    boundary_layer: ArrayLike = 0.1
    scale: str | ArrayLike = "none"
    name: str = "sliding mode"

    def __post_init__(self) -> None:
        check_gains(self, "slope", "gain", "boundary_layer")
        check_scale(self)

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _SlidingModeState(cast("Sequence[SlidingMode]", controllers), arm)


class _SlidingModeState(State):
    def __init__(self, controllers: Sequence[SlidingMode], arm: Arm) -> None:
        runs = len(controllers)
        self._fleet = Fleet([arm], runs)
        self._slope = stacked(controllers, "slope", arm)
        self._gain = stacked(controllers, "gain", arm, scaled=True)
        layer = stacked(controllers, "boundary_layer", arm)
        # Without a layer the ramp is so steep that only its ends are left.
        self._steepness = 1.0 / np.maximum(layer, 1e-300)
        self._saturation = Saturation(arm.effort_limit, runs)
        shape = (runs, arm.n)
        self._v_r, self._a_r, self._x, self._y = (np.zeros(shape) for _ in range(4))
        self._surface, self._torque = np.zeros(shape), np.zeros(shape)

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        v_r, a_r, x, y, torque = self._v_r, self._a_r, self._x, self._y, self._torque
        np.subtract(q_ref, q, out=v_r)
        v_r *= self._slope
        v_r += v_ref
        np.subtract(v_ref, v, out=a_r)
        a_r *= self._slope
        a_r += a_ref
        np.subtract(v, v_r, out=self._surface)

        # C(q, v) w is bilinear and symmetric: c((v + w)/2) - c((v - w)/2) with c(x) = C(q, x) x.
        np.add(v, v_r, out=x)
        x *= 0.5
        self._fleet.inverse_dynamics(q, x, a_r, torque)
        np.multiply(self._surface, 0.5, out=x)
        self._fleet.coriolis(q, x, y)
        torque -= y

        np.multiply(self._surface, self._steepness, out=x)
        np.minimum(np.maximum(x, -1.0, out=x), 1.0, out=x)
        x *= self._gain
        torque -= x
        return self._saturation.apply(torque)

    def signals(self) -> Mapping[str, FloatArray]:
        """Return a view of s, (runs, n)."""
        return {"s": self._surface}

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        self._surface[run] = 0.0
