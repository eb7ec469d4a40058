"""The sums over the whole past that the definitions are: Grünwald-Letnikov's, and L1.

    Grünwald-Letnikov, equation (1):  h^-alpha sum_j (-1)^j binom(alpha, j) f_(k-j)
    L1 (Oldham and Spanier, The Fractional Calculus, 1974), equation (4) with the rate constant on
    every step:
        h^-alpha/Gamma(2 - alpha) sum_j ((j + 1)^(1-alpha) - j^(1-alpha)) (f_(k-j) - f_(k-j-1))

They are references, for recorded signals: a `Bank` streams designs with modes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.fractional.design import INITIALISATIONS, Design, check_grid, check_order


class HistorySum(Design):
    """A weighted sum of all samples so far."""

    #: Whether the sum itself sees a signal jump from 0 to f(0) at t = 0.
    sees_jump = False

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the weights of f_k, f_(k-1), ... for a step of 1, (lags + 1, ...)."""
        raise NotImplementedError

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> FloatArray:
        """Return the weights of f_k, f_(k-1), ... up to the horizon, (lags, ...)."""
        alpha = check_order(order)
        step, horizon = check_grid(step, horizon)
        lag = np.arange(1.0, round(horizon / step) + 1).reshape((-1,) + (1,) * alpha.ndim)
        return self._weights(alpha, lag) * step**-alpha

    def recorded(
        self, f: FloatArray, rate: FloatArray | None, order: FloatArray, step: float, start: str
    ) -> FloatArray:
        """Return D^alpha of signals (N, ...), by FFT; order 1 is the rate, differenced if None.

        `start` is the initialisation, as in `Bank`.
        """
        at_once = checks.choice("initialisation", start, INITIALISATIONS) == "grunwald_letnikov"
        if rate is None:
            rate = np.diff(f, axis=0, prepend=f[:1] * (not at_once)) / step
        elif rate.shape != f.shape:
            raise checks.ArgumentError("rate", f"shape {f.shape}", f"shape {rate.shape}")
        weights = self.coefficients(order, step=step, horizon=max(len(f) - 1, 2) * step)
        seen = at_once and self.sees_jump
        y = scipy.signal.fftconvolve(f - f[0] * (not seen), weights, axes=0)[: len(f)]
        if start != "caputo" and not seen:
            t = step * np.arange(1.0, len(f)).reshape((-1,) + (1,) * order.ndim)
            y[1:] += f[0] * t**-order * scipy.special.rgamma(1.0 - order)
        # The first sample is known exactly; a transform would leave rounding there.
        y[0] = f[0] * step**-order * at_once
        return np.where(order == 0.0, f, np.where(order == 1.0, rate, y))


@dataclass(frozen=True)
class GrunwaldLetnikov(HistorySum):
    """The sum (1); first order in the step.

    Under Caputo's initialisation it works on f - f(0).
    """

    sees_jump = True

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return (-1)^j binom(alpha, j)."""
        ratios = np.concatenate([np.ones((1, *order.shape)), 1.0 - (order + 1.0) / lag])
        return np.cumprod(ratios, axis=0)


@dataclass(frozen=True)
class L1(HistorySum):
    """Caputo's integral (4) with the rate constant on every step; order 2 - alpha in the step."""

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the differences of ((j + 1)^(1-alpha) - j^(1-alpha))/Gamma(2 - alpha)."""
        power = 1.0 - order
        # The difference of two nearly equal powers, without subtracting them.
        tail = lag**power * np.expm1(power * np.log1p(1.0 / lag))
        weights = np.concatenate([np.ones((1, *order.shape)), tail])
        return np.asarray(np.diff(weights, axis=0, prepend=0.0) * scipy.special.rgamma(1.0 + power))
