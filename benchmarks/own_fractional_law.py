"""A fractional law of one's own, with an adaptation rule of its own: what `speed.py` times.

The normalised MIT rule, K' = -gamma e phi/(a + phi^2), for each gain and its regressor phi (Åström
and Wittenmark, *Adaptive Control*, 2008, section 5.3). A Caputo operator of e rests at e = e(0): a
proportional term has to be there.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.control import Derivative, Integral


@dataclass(frozen=True, eq=False)
class NormalisedMit(fp.Controller):
    """``u = s (Kp e + Ki I^lambda e + Kd D^mu e)`` with normalised gradients of e^2/2."""

    kp: ArrayLike
    ki: ArrayLike
    kd: ArrayLike
    integral_order: ArrayLike = 0.9
    derivative_order: ArrayLike = 0.9
    gamma: ArrayLike = 1.0
    floor: ArrayLike = 1e-2

    operators: ClassVar = {
        "i_e": Integral("integral_order"),
        "d_e": Derivative("derivative_order"),
    }
    shown: ClassVar = {"kp": "kp", "ki": "ki", "kd": "kd"}

    @staticmethod
    def torque(c: Any) -> Any:
        return c.kp * c.e + c.ki * c.i_e + c.kd * c.d_e

    @staticmethod
    def adapt(c: Any) -> None:
        size = c.floor + c.e * c.e + c.i_e * c.i_e + c.d_e * c.d_e
        rate = c.h * c.gamma * c.e / size
        c.kp += rate * c.e
        c.ki += rate * c.i_e
        c.kd += rate * c.d_e
