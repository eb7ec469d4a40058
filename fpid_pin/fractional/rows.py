"""A design's coefficients in the basis in which a bank advances them.

With `StepIntegrals` (E, now, before, gain) a mode x' = -p x + f' and its part of the output are,
f counted from its first value,

    x_k = now f'_k + gain f_k + beta w_k,        w_(k+1) = E w_k + f_k + sigma f'_k
    beta = -gain (1 - E),   sigma = (E now + before)/beta

so that one sample is a weighted sum over the rows [f_k, f'_k, f_(k-1), f'_(k-1), w_k] and the
recursion of w. The mode with p = 0 is f itself and needs no row. Where rates are differenced,
f' has no rows and ``gain`` is that of a constant rate. A start from rest adds one row that holds
f(0), for the mode with p = 0.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.fractional.design import Coefficients
from fpid_pin.fractional.step_integrals import step_integrals


@dataclass(frozen=True, eq=False)
class Rows:
    """Row weights and the modes' constants, for channels in a flat trailing axis.

    Attributes
    ----------
    weights
        (rows, channels): inputs now, inputs before, f(0) where asked for, modes.
    decay, sigma, beta, gain, before, now, poles
        Constants of the modes with p > 0: (modes, 1) where the poles are shared, else
        (modes, channels).
    """

    weights: FloatArray
    decay: FloatArray
    sigma: FloatArray
    beta: FloatArray
    gain: FloatArray
    now: FloatArray
    before: FloatArray
    poles: FloatArray

    @property
    def kappa(self) -> FloatArray:
        """What w gains for each unit by which the last rate alone is replaced."""
        return self.before / self.beta

    def start(self, past: FloatArray, rate: FloatArray) -> FloatArray:
        """Return w at t = 0 for modes that hold `past` (f(0) or 0) and the rate f'(0)."""
        return (past - self.now * rate) / self.beta

    def modes(self, w: FloatArray, value: FloatArray, rate: FloatArray) -> FloatArray:
        """Return the modes x after the sample (value, rate) that w has already taken in."""
        decayed = self.beta * w + self.gain * value - self.before * rate
        # A mode so fast that nothing of it outlives a step is at rest with the rate.
        alive = self.decay > 1e-12
        return np.where(alive, decayed / np.where(alive, self.decay, 1.0), rate / self.poles)

    def from_modes(self, modes: FloatArray, value: FloatArray, rate: FloatArray) -> FloatArray:
        """Return w for given modes: the inverse of `modes`."""
        decayed = self.decay * modes - self.gain * value + self.before * rate
        return decayed / self.beta


def rows(c: Coefficients, *, measured: bool, from_rest: bool, channels: int) -> Rows:
    """Put coefficients into rows.

    Parameters
    ----------
    c
        Of a design with modes.
    measured
        Whether the rate is an input of its own.
    from_rest
        Whether there is a row for f(0).
    channels
        At least the number of orders; with one order and two channels it is repeated.
    """

    def columns(array: FloatArray) -> FloatArray:
        lead = array.shape[: array.ndim - c.order.ndim]
        flat = array.reshape(*lead, c.order.size)
        return np.repeat(flat, channels // c.order.size, axis=-1)

    poles = c.poles[:, None] if c.shared_poles else columns(c.poles)
    one = step_integrals(poles, c.step)
    gain = one.gain if measured else one.flat_gain
    now = one.now if measured else np.zeros_like(poles)
    before = one.before if measured else now
    beta = gain * np.expm1(-poles * c.step)
    g = columns(c.weights)
    past = 2 if measured else 1
    head = 2 * past + from_rest
    weights = np.zeros((head + poles.shape[0] - 1, channels))
    if measured:
        mean = columns(c.mean)
        weights[0] = mean / c.step
        weights[1] = columns(c.now) - 0.5 * mean
        weights[3] = columns(c.before) - 0.5 * mean - (g * before).sum(axis=0)
    else:
        weights[0] = columns(c.chord) / c.step
    weights[past] = (g * gain).sum(axis=0) - weights[0]
    if from_rest:
        weights[head - 1] = g[0]
    weights[head:] = (g * beta)[1:]
    # The ends are exact: order 1 is the newest rate alone; a bank copies order 0 from its input.
    order = columns(c.order)
    weights[:, (order == 0.0) | (order == 1.0)] = 0.0
    if measured:
        weights[1, order == 1.0] = 1.0
    else:
        weights[0, order == 1.0], weights[1, order == 1.0] = 1.0 / c.step, -1.0 / c.step
    return Rows(
        weights=weights,
        decay=one.decay[1:],
        sigma=(one.decay * now + before)[1:] / beta[1:],
        beta=beta[1:],
        gain=gain[1:],
        now=now[1:],
        before=before[1:],
        poles=poles[1:],
    )
