"""Adaptive control of an arm with unknown inertial parameters (Slotine and Li)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.baselines.regressor import Regressor, parameter_spread
from fpid_pin.control.controller import Controller, State
from fpid_pin.control.parameters import check_gains, check_scale, stacked
from fpid_pin.control.saturation import Saturation
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


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
        1/s, scalar or (n,).
    damping
        K_D, N m s/rad over the scale's unit (so 1/s with ``"inertia"``), scalar or (n,).
    adaptation_rate
        Gamma is this times the square of each parameter's natural size (m, m r, m r^2 of its
        link); 0 leaves the nominal parameters.
    initial
        The estimate at t = 0 as a part of the nominal parameters: 1 trusts the model, 0 knows
        nothing.
    friction
        Whether F_v and F_d of each joint are estimated too, from 0, with the regressors v_r and
        tanh(v_r/0.05 rad/s).
    leakage
        Pull of theta towards its initial value, 1/s; against drift under noise, at the price of
        an error that no longer vanishes (sigma-modification).
    scale
        s_j: ``"none"`` (1), ``"inertia"`` (M_jj at home), or (n,).
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

    @classmethod
    def start_many(
        cls, controllers: Sequence[Controller], arm: Arm, *, step: float, horizon: float
    ) -> State:
        """Start all `controllers` in one state; see `Controller.start_many`."""
        return _SlotineLiState(cast("Sequence[SlotineLi]", controllers), arm, step)


class _SlotineLiState(State):
    def __init__(self, controllers: Sequence[SlotineLi], arm: Arm, step: float) -> None:
        runs, n = len(controllers), arm.n
        self._slope = stacked(controllers, "slope", arm)
        self._damping = stacked(controllers, "damping", arm, scaled=True)
        self._saturation = Saturation(arm.effort_limit, runs)
        self._regressor = Regressor(arm, runs)
        nominal = arm.inertial_parameters
        spread = parameter_spread(arm)
        rate = np.array([c.adaptation_rate for c in controllers])[:, np.newaxis]
        frictional = np.array([c.friction for c in controllers])[:, np.newaxis]
        # The last 2 n parameters are F_v and F_d.
        known = np.array([c.initial for c in controllers])[:, np.newaxis] * nominal
        self.parameters = np.hstack([known, np.zeros((runs, 2 * n))])
        self._initial = self.parameters.copy()
        self._rate = -step * rate * spread**2
        self._rate[:, 10 * n :] *= frictional
        self._leak = step * np.array([c.leakage for c in controllers])[:, np.newaxis]
        self._adapts, self._leaks = bool(self._rate.any()), bool(self._leak.any())
        shape = (runs, n)
        self._v_r, self._a_r, self._torque = (np.zeros(shape) for _ in range(3))
        self._surface, self._driver = np.zeros(shape), np.zeros(shape)
        self._products = np.zeros_like(self._regressor.value)
        self._increment = np.zeros_like(self.parameters)

    def torque(
        self,
        q: FloatArray,
        v: FloatArray,
        q_ref: FloatArray,
        v_ref: FloatArray,
        a_ref: FloatArray,
    ) -> FloatArray:
        """See `State.torque`."""
        if self._adapts:
            self._adapt()
        v_r, a_r, torque = self._v_r, self._a_r, self._torque
        np.subtract(q_ref, q, out=v_r)
        v_r *= self._slope
        v_r += v_ref
        np.subtract(v_ref, v, out=a_r)
        a_r *= self._slope
        a_r += a_ref
        np.subtract(v, v_r, out=self._surface)
        y = self._regressor.update(q, v, v_r, a_r)
        np.einsum("rjp,rp->rj", y, self.parameters, out=torque)
        torque += self._regressor.rotor
        np.multiply(self._damping, self._surface, out=self._driver)
        torque -= self._driver
        return self._saturation.apply(torque)

    def _adapt(self) -> None:
        """Move the parameters by one step, with the regressor and S of the last tick.

        A joint whose torque was cut tells nothing about the parameters while adapting to it would
        ask for more torque yet.
        """
        driver, increment = self._driver, self._increment
        np.copyto(driver, self._surface)
        hold = self._saturation.winds_up(-self._surface)
        if hold is not None:
            driver[hold] = 0.0
        np.multiply(self._regressor.value, driver[:, :, np.newaxis], out=self._products)
        np.add.reduce(self._products, axis=1, out=increment)
        increment *= self._rate
        if self._leaks:
            increment -= self._leak * (self.parameters - self._initial)
        self.parameters += increment

    def signals(self) -> Mapping[str, FloatArray]:
        """Return a view of s, (runs, n)."""
        return {"s": self._surface}

    def retire(self, run: int) -> None:
        """See `State.retire`."""
        for array in (self.parameters, self._initial, self._surface, self._torque):
            array[run] = 0.0
        self._rate[run] = 0.0
        self._regressor.value[run] = 0.0
