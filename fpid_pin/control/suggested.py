"""The adaptive FPID with suggested gains, and rates of its orders, for any arm."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import Flag, Number, OneOf
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.gains import LEARNING_ERROR, LEARNING_TIME, suggest_gains
from fpid_pin.control.law import Controller
from fpid_pin.control.observer_bandwidth import SUGGESTED
from fpid_pin.descriptions import described

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

Bandwidth = Annotated[float | str, OneOf(SUGGESTED), Number("rad/s", low=0.0)]


@described("suggested_fpid")
@dataclass(frozen=True, eq=False)
class SuggestedFpid(Controller):
    """The adaptive FPID of `suggest_gains`, on whatever arm it is started: for configurations.

    Parameters
    ----------
    bandwidth, integral_order, derivative_order, adaptive, feedforward, observer
        See `suggest_gains`.
    order_learning_rate
        Of both orders, 0: they stay; or ``"suggested"``: rates and bounds of `adapt_orders`.
    name
        What tables and figures call it.
    """

    bandwidth: Annotated[float, Number("rad/s", above=0.0)] = 10.0
    integral_order: Annotated[float, Number(low=0.0, high=1.0)] = 0.9
    derivative_order: Annotated[float | None, Number(low=0.0, high=1.0)] = None
    adaptive: Annotated[bool, Flag] = True
    order_learning_rate: Annotated[float | str, OneOf(SUGGESTED), Number(low=0.0)] = 0.0
    observer: Bandwidth = field(default=0.0, kw_only=True)  # type: ignore[assignment]
    name: str = field(default="FPID, suggested gains", kw_only=True)

    def on(self, arm: Arm, *, step: float = 1e-3, horizon: float = 3600.0) -> AdaptiveFpid:
        """Return the controller that this is on `arm`."""
        law = suggest_gains(
            arm, self.bandwidth, integral_order=self.integral_order,
            derivative_order=self.derivative_order, adaptive=self.adaptive,
            feedforward=self.feedforward, observer=self.observer, step=step, horizon=horizon,
            name=self.name,
        )  # fmt: skip
        if self.order_learning_rate == SUGGESTED:
            return adapt_orders(law, arm)
        return dataclasses.replace(law, order_learning_rate=self.order_learning_rate)


def adapt_orders(controller: AdaptiveFpid, arm: Arm, *, speed: float = 1.0) -> AdaptiveFpid:
    """Return a law with orders that adapt, downwards from the largest that it has.

    An error of 0.05 rad moves an order by 1 in 5 s, in which by the learning rates of
    `suggest_gains` it doubles a gain. With S about k1 e, and e' like w e,

        gamma_o = 1/(k1 e^2 T s Ki) for lambda,    1/(k1 e^2 T s Kd w^2) for mu,
        e = 0.05 rad,  T = 5 s,  w^2 = s Kp/M_jj

    M_jj at the arm's home. An order beside a gain, or a surface, of 0 stays. Upper bounds are the
    largest lambda and mu of the law: under a load that stays lambda would else end at 1, and mu
    would follow the noise upwards; both cost more than they gain (`benchmarks/RECORD.md`).

    Parameters
    ----------
    controller, arm
        The law, and the arm that it is for.
    speed
        A factor of the rates.

    Raises
    ------
    ArgumentError
        Orders below the lower bounds of the law.
    """
    checks.instance("controller", controller, AdaptiveFpid, "an AdaptiveFpid")
    speed = checks.number("speed", speed, low=0.0)
    kp, ki, kd, k1, lam, mu = (
        checks.per_joint(name, getattr(controller, name), arm.n)
        for name in ("kp", "ki", "kd", "k1", "integral_order", "derivative_order")
    )
    scale = controller.scale_on(arm)
    square = scale * kp / np.diag(arm.mass_matrix(arm.home))  # w^2 [1/s^2]
    strength = k1 * LEARNING_ERROR**2 * LEARNING_TIME * scale * np.stack([ki, kd * square])
    rate = np.divide(speed, strength, out=np.zeros_like(strength), where=strength > 0.0)
    return dataclasses.replace(
        controller,
        order_learning_rate=rate,
        integral_order_bounds=(controller.integral_order_bounds[0], lam.max()),
        derivative_order_bounds=(controller.derivative_order_bounds[0], mu.max()),
    )
