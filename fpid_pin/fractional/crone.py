"""CRONE: Oustaloup's band-limited filters, the realisation that the paper names.

    H(s) = K prod_k (s + z_k)/(s + p_k),   k = -N..N,   K = high^alpha
    z_k, p_k = low (high/low)^((k + N + (1 -/+ alpha)/2)/(2N + 1))

(Oustaloup, Levron, Mathieu and Nanot, IEEE Trans. Circuits Syst. I 47(1), 2000). In partial
fractions H(s) = h0 + sum g_i s/(s + p_i) with every g_i > 0, which is an exponential-sum kernel
whose poles depend on the order: the same bank runs it. It never goes through polynomial
coefficients, in s or in z, whose roots leave the unit circle already at N = 5.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, read_only
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional.design import Design, check_grid, check_order
from fpid_pin.fractional.modes import Modes
from fpid_pin.fractional.step_integrals import integrate_step


@dataclass(frozen=True)
class Oustaloup(Design):
    """What the filters have in common: a band, 2N + 1 pairs of zeros and poles, widening.

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

    low: float = 1e-2
    high: float = 1e3
    n: int = 5
    widening: float = 0.0

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            object.__setattr__(self, name, checks.number(name, getattr(self, name), above=0.0))
        if not self.low < self.high:
            raise ArgumentError("band", "low < high", f"low = {self.low:g}, high = {self.high:g}")
        object.__setattr__(self, "n", checks.integer("n", self.n, low=1, high=60))
        widening = checks.number("widening", self.widening, low=0.0, high=10.0)
        object.__setattr__(self, "widening", widening)

    @property
    def designed_band(self) -> tuple[float, float]:
        """The band with its widening [rad/s]."""
        factor = 10.0**self.widening
        return self.low / factor, self.high * factor

    @abstractmethod
    def zpk(self, order: float) -> tuple[FloatArray, FloatArray, float]:
        """Return zeros, poles [rad/s, negative real] and gain of H(s) for one order."""

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Modes:
        """Return the modes' coefficients; the poles depend on the order.

        The newest step is part of the filter: its weights are those of the modes themselves.
        Orders 0 and 1 are the identity and the rate, not a filter.
        """
        alpha = check_order(order)
        step, _ = check_grid(step, horizon)
        flat = alpha.reshape(-1)
        columns = [self._partial_fractions(float(a)) for a in flat]
        poles = np.stack([p for p, _ in columns], axis=1)
        weights = np.stack([g for _, g in columns], axis=1)
        one = integrate_step(poles, step)
        # Order 1 is f' alone, which no mode makes.
        rate = np.where(flat == 1.0, 1.0, 0.0)
        shape = (len(poles), *alpha.shape)
        return Modes(
            order=alpha,
            step=step,
            poles=read_only(poles.reshape(shape)),
            weights=weights.reshape(shape),
            now=((weights * one.now).sum(axis=0) + rate).reshape(alpha.shape),
            before=(weights * one.before).sum(axis=0).reshape(alpha.shape),
            mean=(weights * one.mean).sum(axis=0).reshape(alpha.shape),
            kick=(weights.sum(axis=0) + rate / step).reshape(alpha.shape),
        )

    def _partial_fractions(self, order: float) -> tuple[FloatArray, FloatArray]:
        """Return poles (modes,) [1/s] with 0 first, and weights: H(s)/s = sum g_i/(s + p_i)."""
        # The ends have no filter of their own; an inner order keeps the arrays' shapes.
        inner = order if 0.0 < order < 1.0 else 0.5
        # Nearer to an end, zeros and poles meet within rounding and a quotient is 0/0.
        zeros, poles, gain = self.zpk(min(max(inner, 1e-9), 1.0 - 1e-9))
        z, p = np.sort(-zeros), np.sort(np.concatenate([[0.0], -poles]))
        # Residues of H(s)/s. Zeros and poles interlace: paired in order, each factor is of order
        # one and no product overflows. Where H(0) = 0 that of the pole at 0 vanishes by itself.
        index = np.arange(p.size)
        others = np.stack([np.delete(index, i) for i in index], axis=1)
        ratios = (z[:, None] - p) / (p[others] - p)
        weights = gain * np.abs(ratios.prod(axis=0))
        # The mode with p = 0 is f - f(0): alone it is order 0.
        return p, weights if inner == order else (1.0 - order) * (p == 0.0)


def _oustaloup(low: float, high: float, n: int, order: float) -> tuple[FloatArray, FloatArray]:
    k = np.arange(-n, n + 1)
    ratio = high / low
    zeros = low * ratio ** ((k + n + 0.5 * (1.0 - order)) / (2 * n + 1))
    poles = low * ratio ** ((k + n + 0.5 * (1.0 + order)) / (2 * n + 1))
    return zeros, poles


@described("crone")
@dataclass(frozen=True)
class Crone(Oustaloup):
    """Oustaloup's filter over [low, high] rad/s: the paper's own realisation.

    Its poles depend on the order, so that an order which changes while running leaves a bump.
    """

    __doc__ = (__doc__ or "") + (Oustaloup.__doc__ or "").partition("\n")[2]

    def zpk(self, order: float) -> tuple[FloatArray, FloatArray, float]:
        """Return zeros, poles [rad/s, negative real] and gain of H(s) for one order."""
        order = checks.number("order", order, low=0.0, high=1.0)
        low, high = self.designed_band
        zeros, poles = _oustaloup(low, high, self.n, order)
        return -zeros, -poles, high**order


@described("refined_oustaloup")
@dataclass(frozen=True)
class RefinedOustaloup(Oustaloup):
    """The refined filter of Xue, Zhao and Chen (2006), with its gain bias corrected.

    Oustaloup's filter times ``s (d s + b high) / (d (1 - alpha) s^2 + b high s + d alpha)`` with
    b = 10, d = 9. As published the gain is ``(d high/b)^alpha``, which is too small by
    ``(d/b)^alpha`` all through the band (10 % at order 0.9); here it is ``high^alpha``.
    """

    __doc__ = (__doc__ or "") + (Oustaloup.__doc__ or "").partition("\n")[2]

    def zpk(self, order: float) -> tuple[FloatArray, FloatArray, float]:
        """Return zeros, poles [rad/s, negative real] and gain of H(s) for one order in (0, 1)."""
        order = checks.number("order", order, above=0.0, high=1.0)
        if order == 1.0:
            raise ArgumentError("order", "a number in (0, 1)", "1 (not a proper filter)")
        low, high = self.designed_band
        zeros, poles = _oustaloup(low, high, self.n, order)
        b, d = 10.0, 9.0
        root = (b * high) ** 2 - 4.0 * d * d * order * (1.0 - order)
        if root <= 0.0:
            raise DesignError(
                "refined Oustaloup: expected a band whose upper end gives real poles"
                f" (above {d / b:g} rad/s for every order), got {high:g} rad/s"
            )
        # The larger root without cancellation, the smaller from their product alpha/(1 - alpha).
        fast = (b * high + root**0.5) / (2.0 * d * (1.0 - order))
        slow = order / (1.0 - order) / fast
        zeros = np.concatenate([[0.0], zeros, [b * high / d]])
        poles = np.concatenate([[slow], poles, [fast]])
        return -zeros, -poles, high**order / (1.0 - order)
