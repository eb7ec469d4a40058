"""The plain rules that keep the signal's past: Grünwald-Letnikov and L1, streamed.

They are references: a sample costs a sum over the whole past (or over a short memory).

    Grünwald-Letnikov, equation (1):  h^-alpha sum_j w_j f_(k-j),   w_j = (-1)^j binom(alpha, j)
    L1, equation (4) with the rate constant on every step:
        h^-alpha/Gamma(2 - alpha) sum_j a_j (f_(k-j) - f_(k-j-1)),
        a_j = (j + 1)^(1-alpha) - j^(1-alpha)
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.fractional.bank import _NEVER, Bank
from fpid_pin.fractional.design import Design, check_grid, check_order
from fpid_pin.fractional.special import rgamma


@dataclass(frozen=True, eq=False)
class LagCoefficients:
    """Weights of a rule that keeps the past: (lags, ...) for orders (...), newest first.

    They multiply samples f (Grünwald-Letnikov) or increments f_k - f_(k-1) (L1).
    """

    order: FloatArray
    step: float
    weights: FloatArray


@dataclass(frozen=True, eq=False)
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

    @property
    @abstractmethod
    def of_increments(self) -> bool:
        """Whether the weights multiply increments instead of samples."""

    @abstractmethod
    def weights(self, order: FloatArray, count: int, step: float) -> FloatArray:
        """Return `count` weights, newest first, for orders (...): (count, ...)."""

    def lag_count(self, step: float, horizon: float) -> int:
        """Return how many samples of the past are in use at most."""
        span = horizon if self.memory is None else min(self.memory, horizon)
        return max(math.floor(span / step + 0.5), 1) + 1

    def coefficients(self, order: ArrayLike, *, step: float, horizon: float) -> LagCoefficients:
        """Return the weights of every lag up to the memory or the horizon."""
        alpha = check_order(order)
        step, horizon = check_grid(step, horizon)
        count = self.lag_count(step, horizon)
        return LagCoefficients(alpha, step, self.weights(alpha, count, step))

    @classmethod
    def _bank_class(cls) -> type[Bank]:
        return HistoryBank


@described("grunwald_letnikov")
@dataclass(frozen=True, eq=False)
class GrunwaldLetnikov(HistoryDesign):
    """The sum (1), streamed; first order in the step.

    Under Caputo's initialisation it works on f - f(0).

    Parameters
    ----------
    memory
        Length of the past that is kept [s]; None keeps all of it.
    """

    @property
    def of_increments(self) -> bool:
        """False: the weights multiply samples."""
        return False

    def weights(self, order: FloatArray, count: int, step: float) -> FloatArray:
        """Return h^-alpha (-1)^j binom(alpha, j), (count, ...)."""
        lag = np.arange(1, count).reshape((-1,) + (1,) * order.ndim)
        first = np.ones((1, *order.shape))
        ratios = 1.0 - (order + 1.0) / lag
        return np.asarray(np.cumprod(np.concatenate([first, ratios]), axis=0) * step**-order)


@described("l1")
@dataclass(frozen=True, eq=False)
class L1(HistoryDesign):
    """Caputo's integral (4) with the rate constant on every step, streamed; order 2 - alpha.

    Parameters
    ----------
    memory
        Length of the past that is kept [s]; None keeps all of it.
    """

    @property
    def of_increments(self) -> bool:
        """True: the weights multiply increments."""
        return True

    def weights(self, order: FloatArray, count: int, step: float) -> FloatArray:
        """Return h^-alpha/Gamma(2 - alpha) ((j + 1)^(1-alpha) - j^(1-alpha)), (count, ...)."""
        lag = np.arange(1, count, dtype=np.float64).reshape((-1,) + (1,) * order.ndim)
        power = 1.0 - order
        # The difference of two nearly equal powers, without subtracting them.
        tail = lag**power * np.expm1(power * np.log1p(1.0 / lag))
        weights = np.concatenate([np.ones((1, *order.shape)), tail])
        return np.asarray(weights * (step**-order * rgamma(2.0 - order)))


class HistoryBank(Bank):
    """A bank for designs that keep the past; `Bank` chooses it by itself."""

    design: HistoryDesign

    def _allocate(self) -> None:
        self._offset = np.zeros(self.shape)
        self._output = np.zeros(self._channels)
        self._output_view = self._output[: self._count].reshape(self.shape)
        self._limit = None
        if self.design.memory is not None:
            self._limit = self.design.lag_count(self.step, self.design.memory)

    def reset(self) -> None:
        """Go back to t = 0; retired channels stay retired."""
        self._capacity = 64
        self._past = np.zeros((self._capacity, self._channels))
        self._top = self._capacity
        self._weights = self._all_weights()
        self._offset[...] = 0.0
        self._output[:] = 0.0
        self._last = np.zeros(self._channels)
        self._ticks = np.zeros(self._channels)
        self._tick = 0
        self._ramp = None
        self._end, self._event = _NEVER, 0

    def _all_weights(self) -> FloatArray:
        count = self._capacity if self._limit is None else min(self._capacity, self._limit)
        return self._columns(self.design.weights(self.order, count, self.step))

    def _grow(self) -> None:
        """Make room below the newest sample."""
        used = self._past[: len(self._weights) - 1] if self._limit is not None else self._past
        if self._limit is None or self._capacity < 2 * self._limit:
            self._capacity *= 2
            self._weights = self._all_weights()
        past = np.zeros((self._capacity, self._channels))
        past[self._capacity - len(used) :] = used
        self._past, self._top = past, self._capacity - len(used)

    def update(
        self,
        value: NDArray[np.float64],
        rate: NDArray[np.float64] | None = None,
        out: NDArray[np.float64] | None = None,
        hold: NDArray[np.bool_] | None = None,
    ) -> NDArray[np.float64]:
        """Take one sample and return D^alpha f at it: see `Bank.update`.

        The rules use the value alone; a measured rate is the output of order 1.
        """
        start = self._tick == 0
        if self._tick == self._event and not start:
            self._attend()
        sample = np.zeros(self.shape)
        try:
            sample[...] = value
            given = np.zeros(self.shape)
            if self._measured:
                np.copyto(given, rate)  # type: ignore[arg-type]
            elif rate is not None:
                raise ValueError
        except (TypeError, ValueError):
            raise self._wrong(value, rate) from None
        living = np.ones(self.shape, dtype=bool)
        if self._dead is not None:
            living = ~self._dead[: self._count].reshape(self.shape)
            sample[~living] = 0.0
        if start:
            hold = None
            from_rest = self.initialisation == "grunwald_letnikov"
            self._first = sample.copy()
            self._offset[...] = 0.0 if from_rest and not self.design.of_increments else sample
        still = np.zeros(self._channels, dtype=bool)
        if hold is not None:
            held = np.broadcast_to(hold, self.shape)
            still = self._columns(held)
            drift = self._columns(sample - self._offset) - self._last
            self._offset += np.where(held, drift[: self._count].reshape(self.shape), 0.0)
        counted = self._columns(sample - self._offset)
        self._push(counted, still)
        if not start:
            self._ticks[~still] += 1.0
        result = self._sum()
        self._add_start(result, start)
        if self._measured:
            np.copyto(result, given, where=(self.order == 1.0) & living)
        np.copyto(result, sample, where=self.order == 0.0)
        if hold is not None:
            np.copyto(result, self._output_view, where=held)
        self._output_view[...] = result
        self._tick += 1
        if start:
            self._event = self._tick if self._ramp is not None else _NEVER
        if out is None:
            return self._output_view
        np.copyto(out, self._output_view)
        return out

    def _push(self, counted: FloatArray, still: NDArray[np.bool_]) -> None:
        if self._top == 0:
            self._grow()
        self._top -= 1
        increments = self.design.of_increments
        self._past[self._top] = counted - self._last if increments else counted
        self._last = counted
        if still.any():
            # A clock that stands still: its past moves up with the sample, unchanged.
            column = self._past[self._top :, still]
            self._past[self._top : -1, still] = column[1:]
            self._past[-1, still] = 0.0

    def _sum(self) -> FloatArray:
        past = self._past[self._top : self._top + len(self._weights)]
        total = np.einsum("kc,kc->c", self._weights[: len(past)], past)
        return np.asarray(total[: self._count].reshape(self.shape))

    def _add_start(self, result: FloatArray, start: bool) -> None:
        """Add what f(0) leaves where the signal is taken to have been 0 before t = 0."""
        rest = self.initialisation
        inner = (self.order > 0.0) & (self.order < 1.0)
        if rest == "caputo" or (rest == "grunwald_letnikov" and not self.design.of_increments):
            return
        if start:
            kick = self.step**-self.order * self._first
            if rest == "grunwald_letnikov":
                np.copyto(result, kick, where=inner | (self.order == 1.0))
            return
        t = self._ticks[: self._count].reshape(self.shape) * self.step
        result += np.where(inner, self._first * t**-self.order * rgamma(1.0 - self.order), 0.0)

    def _use(self, order: FloatArray) -> None:
        self.order = order
        self._weights = self._all_weights()
        self._clear_dead()

    def _clear_dead(self) -> None:
        if self._dead is None:
            return
        self._past[:, self._dead] = 0.0
        self._output[self._dead] = 0.0
        self._last[self._dead] = 0.0
        living = ~self._dead[: self._count].reshape(self.shape)
        self._offset[~living] = 0.0
        if self._tick > 0:
            self._first[~living] = 0.0
