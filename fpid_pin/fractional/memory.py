"""What a streaming operator remembers: the modes of a design, or the past itself.

Both take the samples of all channels in a row; a channel that is held keeps its output and what it
remembers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.fractional.design import Design, modes_of
from fpid_pin.fractional.history import HistoryDesign
from fpid_pin.fractional.special import rgamma

_FIRST_ROWS = 64

#: f and f' at this sample, and those at the last: f, f_, f', f'_, each (channels,).
Signals = tuple[FloatArray, FloatArray, FloatArray, FloatArray]


class ModalMemory:
    """The values of a design's modes, in constant memory: `kernels.operator` advances them."""

    def __init__(
        self, design: Design, order: FloatArray, step: float, horizon: float, initialisation: str
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels.operator import sample

        self._sample: Callable[..., Any] = sample
        self._design, self._step, self._horizon = design, step, horizon
        self._initialisation = initialisation
        self._ops, self._poles, self._modes = self._records(order)

    def _records(self, order: FloatArray) -> Any:
        modes = modes_of(self._design, order, step=self._step, horizon=self._horizon)
        return modes.records(self._initialisation)

    def use(self, order: FloatArray) -> None:
        """Take new orders and keep the modes: exact where poles are shared, else with a bump."""
        x = self._modes["x"]
        self._ops, self._poles, self._modes = self._records(order)
        self._modes["x"] = x

    def clear(self, channels: BoolArray) -> None:
        """Forget some channels."""
        self._modes["x"][channels] = 0.0

    def sample(self, started: bool, signals: Signals, held: BoolArray, out: FloatArray) -> None:
        """Take one sample and write D^alpha f of the channels that are not held into `out`."""
        records = self._ops, self._poles, self._modes
        self._sample(started, *records, *signals, held, out, self._step)


class PastMemory:
    """The increments of the signal, (rows, channels), the newest at the top."""

    def __init__(
        self, design: HistoryDesign, order: FloatArray, step: float, initialisation: str
    ) -> None:
        self._design, self._step, self._initialisation = design, step, initialisation
        self._within = design.starts_within(initialisation)
        self._begin(np.zeros(order.size))
        self.use(order)

    def _begin(self, first: FloatArray) -> None:
        self._past = np.zeros((_FIRST_ROWS, first.size))
        self._top = _FIRST_ROWS
        self._total, self._ticks = np.zeros(first.size), np.zeros(first.size)
        self._first = first

    def use(self, order: FloatArray) -> None:
        """Take new orders: the sum goes over the same past with new weights."""
        self._order = order
        horizon = len(self._past) * self._step
        self._lags = self._design.coefficients(order, step=self._step, horizon=horizon)

    def clear(self, channels: BoolArray) -> None:
        """Forget some channels."""
        self._past[:, channels] = 0.0
        self._first[channels] = self._total[channels] = 0.0

    def sample(self, started: bool, signals: Signals, held: BoolArray, out: FloatArray) -> None:
        """Take one sample: see `ModalMemory.sample`. The rate is the output of order 1 alone."""
        f, f_, rate, rate_ = signals
        moving = ~held
        if started:
            increment = np.where(moving, f - f_, 0.0)
            self._ticks += moving
        else:
            self._begin(f.copy())
            self.use(self._order)
            increment = self._first * self._within
        self._push(increment, held)
        past = self._past[self._top : self._top + len(self._lags.weights)]
        y = np.einsum("kc,kc->c", self._lags.weights[: len(past)], past)
        y += self._lags.level * self._total
        if self._initialisation != "caputo" and not self._within:
            y += self._jump(started)
        y = np.where(self._order == 0.0, f, np.where(self._order == 1.0, rate, y))
        np.copyto(out, y, where=moving)
        f_[:], rate_[:] = f, rate

    def _push(self, increment: FloatArray, held: BoolArray) -> None:
        if self._top == 0:
            used = self._past[: len(self._lags.weights)]
            self._past, self._top = np.concatenate([np.zeros_like(used), used]), len(used)
            self.use(self._order)
        self._top -= 1
        self._past[self._top] = increment
        self._total += increment
        if held.any():
            # A clock that stands still: its past moves up with the sample, unchanged.
            self._past[self._top : -1, held] = self._past[self._top + 1 :, held]
            self._past[-1, held] = 0.0

    def _jump(self, started: bool) -> FloatArray:
        """Return what a jump from 0 to f(0) at t = 0 adds to a rule that does not see it."""
        if started:
            t = np.maximum(self._ticks, 1.0) * self._step
            return np.asarray(self._first * t**-self._order * rgamma(1.0 - self._order))
        kick = self._initialisation == "grunwald_letnikov"
        return self._first * self._step**-self._order * kick
