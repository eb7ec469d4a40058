"""The plain rules that keep the signal's past: Grünwald-Letnikov and L1.

They are references: a sample costs a sum over the whole past (or over a short memory, the
short-memory principle of Podlubny, Fractional Differential Equations, 1999).

    Grünwald-Letnikov, equation (1):  h^-alpha sum_j (-1)^j binom(alpha, j) f_(k-j)
    L1 (Oldham and Spanier, The Fractional Calculus, 1974), equation (4) with the rate constant on
    every step:
        h^-alpha/Gamma(2 - alpha) sum_j ((j + 1)^(1-alpha) - j^(1-alpha)) (f_(k-j) - f_(k-j-1))

Both are kept as weights of the samples themselves.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fpid_pin.checks import BoolArray, FloatArray, Number
from fpid_pin.descriptions import described
from fpid_pin.fractional.design import Design, check_grid, check_order

_FIRST_ROWS = 64


@dataclass(frozen=True)
class HistoryDesign(Design):
    """What the two rules have in common.

    Parameters
    ----------
    memory
        Length of the past that is kept [s] (the short-memory principle); None keeps all of it.

    Raises
    ------
    ArgumentError
        A memory that is not positive.
    """

    memory: Annotated[float | None, Number("s", above=0.0)] = None

    @abstractmethod
    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the weights of f_k, f_(k-1), ... for a step of 1, (lags, ...), lags 1, 2, ..."""

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> FloatArray:
        """Return the weights of f_k, f_(k-1), ... up to the memory or the horizon, (lags, ...)."""
        alpha = check_order(order)
        step, horizon = check_grid(step, horizon)
        lag = np.arange(1.0, self.lag_count(step, horizon)).reshape((-1,) + (1,) * alpha.ndim)
        return self._weights(alpha, lag) * step**-alpha

    def lag_count(self, step: float, horizon: float) -> int:
        """Return how many samples of the past are in use at most."""
        span = horizon if self.memory is None else min(self.memory, horizon)
        return max(math.floor(span / step + 0.5), 1) + 1


@described("grunwald_letnikov")
@dataclass(frozen=True)
class GrunwaldLetnikov(HistoryDesign):
    """The sum (1), streamed; first order in the step.

    Under Caputo's initialisation it works on f - f(0).
    """

    __doc__ = (__doc__ or "") + (HistoryDesign.__doc__ or "").partition("\n")[2]

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return (-1)^j binom(alpha, j)."""
        ratios = np.concatenate([np.ones((1, *order.shape)), 1.0 - (order + 1.0) / lag])
        return np.cumprod(ratios, axis=0)


@described("l1")
@dataclass(frozen=True)
class L1(HistoryDesign):
    """Caputo's integral (4) with the rate constant on every step, streamed; order 2 - alpha."""

    __doc__ = (__doc__ or "") + (HistoryDesign.__doc__ or "").partition("\n")[2]

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the differences of ((j + 1)^(1-alpha) - j^(1-alpha))/Gamma(2 - alpha)."""
        power = 1.0 - order
        # The difference of two nearly equal powers, without subtracting them.
        tail = lag**power * np.expm1(power * np.log1p(1.0 / lag))
        # A short memory has no weight for older changes of f.
        forgotten = np.zeros((0 if self.memory is None else 1, *order.shape))
        weights = np.concatenate([np.ones((1, *order.shape)), tail, forgotten])
        scale = scipy.special.rgamma(2.0 - order)
        return np.asarray(np.diff(weights, axis=0, prepend=0.0) * scale)


class Past:
    """The past of many signals as a rule keeps it, and the rule itself.

    Parameters
    ----------
    design, order, step, initialisation
        See `Bank`; orders (channels,).
    """

    def __init__(
        self, design: HistoryDesign, order: FloatArray, step: float, initialisation: str
    ) -> None:
        self._design, self._step, self._initialisation = design, step, initialisation
        self._at_once = initialisation == "grunwald_letnikov"
        # The sum (1) over f itself sees f jump from 0 to f(0) at t = 0; any other rule does not.
        self._sees_jump = self._at_once and isinstance(design, GrunwaldLetnikov)
        self._begin(np.zeros(order.size))
        self.use(order)

    def _begin(self, first: FloatArray) -> None:
        self._first, self._base = first, first * (not self._sees_jump)
        # Newest at the top, less what the signal is taken to have been before t = 0.
        self._past = np.zeros((_FIRST_ROWS, first.size))
        self._samples = np.zeros(first.size)

    def use(self, order: FloatArray) -> None:
        """Take new orders: the sum goes over the same past with new weights."""
        self._order, rows = order, len(self._past)
        # Of a jump from 0 to 1 at t = 0.
        self._initial_output = self._step**-order * self._at_once
        weights = self._design.coefficients(order, step=self._step, horizon=rows * self._step)
        self._weights = weights[:rows]

    def _jump(self, samples: FloatArray) -> FloatArray:
        """Return D^alpha of a jump from 0 to 1 at t = 0, `samples` later, where it is not seen."""
        if self._sees_jump or self._initialisation == "caputo":
            return np.zeros_like(samples)
        later = (np.maximum(samples, 1.0) * self._step) ** -self._order
        later *= scipy.special.rgamma(1.0 - self._order)
        return np.where(samples == 0.0, self._initial_output, later)

    def sample(
        self,
        started: bool,
        f: FloatArray,
        f_: FloatArray,
        rate: FloatArray,
        held: BoolArray,
        out: FloatArray,
    ) -> None:
        """Take one sample and write D^alpha f of the channels that are not held into `out`.

        `f_` is the last sample. The rate is the output of order 1 alone.
        """
        if not started:
            self._begin(f.copy())
            self.use(self._order)
        moving = ~held
        # A channel that is held goes on from where it was: what passes meanwhile is no change.
        self._base += np.where(held, f - f_, 0.0)
        if self._samples.max() == len(self._past) == len(self._weights):
            self._past = np.concatenate([self._past, np.zeros_like(self._past)])
            self.use(self._order)
        self._past[1:, moving] = self._past[:-1, moving]
        self._past[0, moving] = (f - self._base)[moving]
        y = np.einsum("kc,kc->c", self._weights, self._past[: len(self._weights)])
        y += self._first * self._jump(self._samples)
        self._samples += moving
        np.copyto(out, self._with_ends(f, rate, y), where=moving)

    def recorded(self, f: FloatArray, rate: FloatArray) -> FloatArray:
        """Return D^alpha of whole signals (N, channels), in O(N log N)."""
        samples = len(f)
        horizon = samples * self._step
        weights = self._design.coefficients(self._order, step=self._step, horizon=horizon)
        before = f[0] * (not self._sees_jump)
        y = scipy.signal.fftconvolve(f - before, weights, axes=0)[:samples]
        y += f[0] * self._jump(np.arange(float(samples))[:, None])
        # The first sample is known exactly; a transform would leave rounding there.
        y[0] = f[0] * self._initial_output
        return self._with_ends(f, rate, y)

    def _with_ends(self, f: FloatArray, rate: FloatArray, y: FloatArray) -> FloatArray:
        """Return y with orders 0 and 1 exact."""
        return np.where(self._order == 0.0, f, np.where(self._order == 1.0, rate, y))
