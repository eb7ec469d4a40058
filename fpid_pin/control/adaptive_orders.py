"""Orders that adapt: learning rates and bounds that suit the gains of a law on an arm."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.gains import LEARNING_ERROR, LEARNING_TIME

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


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
