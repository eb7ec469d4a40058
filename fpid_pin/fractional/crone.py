"""CRONE: Oustaloup's band-limited filter, the realisation that the paper names.

    H(s) = K prod_k (s + z_k)/(s + p_k),   k = -N..N,   K = high^alpha
    z_k, p_k = low (high/low)^((k + N + (1 -/+ alpha)/2)/(2N + 1))

(Oustaloup, Levron, Mathieu and Nanot, IEEE Trans. Circuits Syst. I 47(1), 2000). In partial
fractions H(s) = h0 + sum g_i s/(s + p_i) with every g_i > 0, which is an exponential-sum kernel
whose poles depend on the order: the same bank runs it. It never goes through polynomial
coefficients, in s or in z, whose roots leave the unit circle already at N = 5.
"""

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, Number, Whole, read_only
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.design import Design, Modes, check_grid, check_order, integrate_step


@described("crone")
@dataclass(frozen=True)
class Crone(Design):
    """Oustaloup's filter over [low, high] rad/s: the paper's own realisation.

    Its poles depend on the order, so that an order which changes while running leaves a bump.

    Parameters
    ----------
    low, high
        Band in which the filter stands for (j omega)^alpha [rad/s].
    n
        Oustaloup's N: the filter has 2N + 1 poles.
    widening
        Decades by which the filter is designed wider than the band, on each side. The error at
        the edges of a band (36 % and 40 degrees for N = 5) falls outside of it with 1.

    Raises
    ------
    ArgumentError
        A band that is reversed or not positive, ``n < 1``, ``widening < 0``.
    """

    low: Annotated[float, Number("rad/s", above=0.0)] = 1e-2
    high: Annotated[float, Number("rad/s", above=0.0)] = 1e3
    n: Annotated[int, Whole(low=1, high=60)] = 5
    widening: Annotated[float, Number("decades", low=0.0, high=10.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.low < self.high:
            raise ArgumentError("band", "low < high", f"low = {self.low:g}, high = {self.high:g}")

    def zpk(self, order: float) -> tuple[FloatArray, FloatArray, float]:
        """Return zeros, poles [rad/s, negative real] and gain of H(s) for one order."""
        order = checks.number("order", order, low=0.0, high=1.0)
        factor = 10.0**self.widening
        low, high = self.low / factor, self.high * factor
        k, n = np.arange(-self.n, self.n + 1), self.n
        zeros, poles = (
            low * (high / low) ** ((k + n + 0.5 * (1.0 + shift)) / (2 * n + 1))
            for shift in (-order, order)
        )
        return -zeros, -poles, high**order

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Modes:
        """Return the modes' coefficients; the poles depend on the order.

        The newest step is part of the filter: its weights are those of the modes themselves.
        Orders 0 and 1 are the identity and the rate, not a filter.
        """
        alpha = check_order(order)
        step, _ = check_grid(step, horizon)
        columns = [self._partial_fractions(float(a)) for a in alpha.reshape(-1)]
        shape = (-1, *alpha.shape)
        poles, weights = (
            np.stack(part, axis=1).reshape(shape) for part in zip(*columns, strict=True)
        )
        one = integrate_step(poles, step)
        # Order 1 is f' alone, which no mode makes.
        rate = np.where(alpha == 1.0, 1.0, 0.0)
        return Modes(
            order=alpha,
            step=step,
            poles=read_only(poles),
            weights=weights,
            now=(weights * one["b1"]).sum(axis=0) + rate,
            before=(weights * one["b0"]).sum(axis=0),
            mean=(weights * one["b2"]).sum(axis=0),
            initial_output=weights.sum(axis=0) + rate / step,
        )

    def _partial_fractions(self, order: float) -> tuple[FloatArray, FloatArray]:
        """Return poles (modes,) [1/s] with 0 first, and weights: H(s)/s = sum g_i/(s + p_i)."""
        # Nearer to an end, zeros and poles meet within rounding and a quotient is 0/0.
        zeros, poles, gain = self.zpk(min(max(order, 1e-9), 1.0 - 1e-9))
        z, p = -zeros, np.concatenate([[0.0], -poles])
        if order in (0.0, 1.0):
            # The mode with p = 0 is f - f(0): alone it is order 0.
            return p, (1.0 - order) * (p == 0.0)
        # Residues of H(s)/s. Zeros and poles interlace: paired in order, each factor is of order
        # one and no product overflows.
        index = np.arange(p.size)
        others = np.stack([np.delete(index, i) for i in index], axis=1)
        ratios = (z[:, None] - p) / (p[others] - p)
        return p, gain * np.abs(ratios.prod(axis=0))
