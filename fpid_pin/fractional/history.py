"""The plain rules that keep the signal's past: Grünwald-Letnikov and L1.

They are references: a sample costs a sum over the whole past (or over a short memory).

    Grünwald-Letnikov, equation (1):  h^-alpha sum_j (-1)^j binom(alpha, j) f_(k-j)
    L1, equation (4) with the rate constant on every step:
        h^-alpha/Gamma(2 - alpha) sum_j ((j + 1)^(1-alpha) - j^(1-alpha)) (f_(k-j) - f_(k-j-1))

Both are kept as weights on the increments of f. By parts, those of the sum (1) are
h^-alpha (-1)^j binom(alpha - 1, j).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.fractional.design import Design, check_grid, check_order
from fpid_pin.fractional.special import rgamma


@dataclass(frozen=True, eq=False)
class Lags:
    """A rule that keeps the past, for orders (...).

        y_k = sum_j weights_j (f_(k-j) - f_(k-j-1)) + level (f_k - f_(-1))

    Attributes
    ----------
    order
        Orders alpha, any shape (...).
    weights
        (lags, ...) [s^-alpha], newest first.
    level
        (...) [s^-alpha]: what a short memory leaves of increments that it has forgotten.
    """

    order: FloatArray
    weights: FloatArray
    level: FloatArray


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

    memory: float | None = None

    def __post_init__(self) -> None:
        if self.memory is not None:
            object.__setattr__(self, "memory", checks.number("memory", self.memory, above=0.0))

    def lag_count(self, step: float, horizon: float) -> int:
        """Return how many samples of the past are in use at most."""
        span = horizon if self.memory is None else min(self.memory, horizon)
        return max(math.floor(span / step + 0.5), 1) + 1

    @abstractmethod
    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Lags:
        """Return the weights of every lag up to the memory or the horizon."""

    def starts_within(self, initialisation: str) -> bool:
        """Return whether the rule itself makes the start: its first increment is then f(0)."""
        return False


@described("grunwald_letnikov")
@dataclass(frozen=True)
class GrunwaldLetnikov(HistoryDesign):
    """The sum (1), streamed; first order in the step.

    Under Caputo's initialisation it works on f - f(0).
    """

    __doc__ = (__doc__ or "") + (HistoryDesign.__doc__ or "").partition("\n")[2]

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Lags:
        """Return h^-alpha (-1)^j binom(alpha - 1, j) for every lag."""
        alpha = check_order(order)
        step, horizon = check_grid(step, horizon)
        lag = np.arange(1, self.lag_count(step, horizon)).reshape((-1,) + (1,) * alpha.ndim)
        ratios = np.concatenate([np.ones((1, *alpha.shape)), 1.0 - alpha / lag])
        weights = np.cumprod(ratios, axis=0) * step**-alpha
        # A short memory forgets samples: of an older increment the sum of the weights remains.
        level = np.zeros(alpha.shape) if self.memory is None else weights[-1]
        return Lags(alpha, weights - level, level)

    def starts_within(self, initialisation: str) -> bool:
        """Return whether the sum runs over f itself, 0 before t = 0."""
        return initialisation == "grunwald_letnikov"


@described("l1")
@dataclass(frozen=True)
class L1(HistoryDesign):
    """Caputo's integral (4) with the rate constant on every step, streamed; order 2 - alpha."""

    __doc__ = (__doc__ or "") + (HistoryDesign.__doc__ or "").partition("\n")[2]

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> Lags:
        """Return h^-alpha/Gamma(2 - alpha) ((j + 1)^(1-alpha) - j^(1-alpha)) for every lag."""
        alpha = check_order(order)
        step, horizon = check_grid(step, horizon)
        lag = np.arange(1.0, self.lag_count(step, horizon)).reshape((-1,) + (1,) * alpha.ndim)
        power = 1.0 - alpha
        # The difference of two nearly equal powers, without subtracting them.
        tail = lag**power * np.expm1(power * np.log1p(1.0 / lag))
        weights = np.concatenate([np.ones((1, *alpha.shape)), tail])
        return Lags(alpha, weights * (step**-alpha * rgamma(2.0 - alpha)), np.zeros(alpha.shape))
