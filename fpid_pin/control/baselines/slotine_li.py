"""Adaptive control of an arm with unknown inertial parameters (Slotine and Li)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.baselines.regressor import Regressor, parameter_spread
from fpid_pin.control.controller import Controller
from fpid_pin.control.parameters import check_gains, check_scale
from fpid_pin.control.state import LawState
from fpid_pin.descriptions import described


@described("slotine_li")
@dataclass(frozen=True, eq=False)
class SlotineLi(Controller):
    """``u = Y(q, q', v_r, v'_r) theta - s_j K_D S`` with ``theta' = -Gamma Y^T S``.

    v_r = q'_d + slope e, S = q' - v_r, and Y theta = M v'_r + C v_r + G is linear in the ten
    inertial parameters of each link. S tends to 0 in continuous time whatever the parameters
    (Slotine and Li, International Journal of Robotics Research 6(3), 1987; *Applied Nonlinear
    Control*, 1991, section 9.2). Rotor inertia counts as known.

    Parameters
    ----------
    slope
        [1/s], scalar or (n,).
    damping
        K_D [N m s/rad] over the scale's unit (so [1/s] with ``"inertia"``), scalar or (n,).
    adaptation_rate
        Gamma is this times the square of each parameter's natural size (mass, times its reach,
        times that squared); 0 leaves the nominal parameters.
    initial
        The estimate at t = 0 as a part of the nominal parameters: 1 trusts the model, 0 knows
        nothing.
    friction
        Whether F_v and F_d of each joint are estimated too, from 0, with the regressors v_r and
        tanh(v_r/0.05 rad/s).
    leakage
        Pull of theta towards its initial value [1/s]; against drift under noise, at the price of
        an error that no longer vanishes (sigma-modification).
    scale
        Factor s_j: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
    name
        What tables and figures call it.
    """

    slope: ArrayLike
    damping: ArrayLike
    adaptation_rate: float = 1.0
    initial: float = 1.0
    friction: bool = True
    leakage: float = 0.0
    scale: str | ArrayLike = "none"
    name: str = "Slotine-Li"

    def __post_init__(self) -> None:
        check_gains(self, "slope", "damping")
        check_scale(self)
        for name in ("adaptation_rate", "initial", "leakage"):
            value = checks.number(name, getattr(self, name), low=0.0)
            object.__setattr__(self, name, value)
        checks.instance("friction", self.friction, bool, "true or false")

    def begin(self: Any, state: LawState) -> None:
        """Prepare the regressor, the estimate and the rates at which it moves."""
        n = state.n
        # The last 2 n parameters are F_v and F_d.
        known = np.outer(self.initial[:, 0], state.arm.inertial_parameters)
        initial = np.hstack([known, np.zeros((state.runs, 2 * n))])
        rate = self.adaptation_rate[:, :1] * parameter_spread(state.arm) ** 2
        rate[:, 10 * n :] *= self.friction
        regressor = Regressor(state.arm, state.runs)
        state.memory["regressor"], state.memory["y"] = regressor, regressor.value
        state.memory["initial"], state.memory["parameters"] = initial, initial.copy()
        state.memory["rate"] = rate
        state.shown["s"] = np.zeros_like(state.torque)

    def torque(
        self: Any, state: LawState, q: FloatArray, v: FloatArray,
        q_ref: FloatArray, v_ref: FloatArray, a_ref: FloatArray,
    ) -> Any:  # fmt: skip
        """See `Controller.torque`."""
        self._adapt(state)
        v_r = v_ref + self.slope * (q_ref - q)
        a_r = a_ref + self.slope * (v_ref - v)
        s = state.shown["s"]
        s[:] = v - v_r
        regressor = state.memory["regressor"]
        y = regressor.update(q, v, v_r, a_r)
        model = np.einsum("rjp,rp->rj", y, state.memory["parameters"]) + regressor.rotor
        return model - self.scale * self.damping * s

    def _adapt(self: Any, state: LawState) -> None:
        """Move the parameters by one step, with the regressor and S of the last tick.

        A joint whose torque was cut tells nothing about the parameters while adapting to it would
        ask for more torque yet.
        """
        s, parameters = state.shown["s"], state.memory["parameters"]
        driver = np.where(state.winds_up(-s), 0.0, s)
        gradient = np.add.reduce(state.memory["y"] * driver[:, :, np.newaxis], axis=1)
        pull = self.leakage[:, :1] * (parameters - state.memory["initial"])
        parameters -= state.step * (state.memory["rate"] * gradient + pull)
