"""What a design does to a sinusoid, to a step and to noise, against the exact operator.

`operator_report` takes its figures from here. Orders are (orders,), step and horizon in seconds.
"""

from __future__ import annotations

import numpy as np
import scipy

from fpid_pin.checks import FloatArray
from fpid_pin.fractional.design import ComplexArray, Design, modes_of
from fpid_pin.fractional.exponential_sum import ExponentialSum
from fpid_pin.fractional.history import GrunwaldLetnikov, HistoryDesign


def frequency_response(
    design: Design, order: FloatArray, omega: FloatArray, *, step: float, horizon: float
) -> ComplexArray:
    """Return the sampled operator's response to exp(j omega t), once its start has died away.

    The exact operator's is ``(j omega)^alpha``. Frequencies are (k,) [rad/s], results (k, orders).
    """
    # One sample later is a factor exp(j omega h); of f = exp(j omega t) the rate is j omega f.
    back = np.exp(-1j * omega * step)
    inputs = np.stack([np.ones_like(back), 1j * omega])
    out = np.empty((omega.size, order.size), dtype=np.complex128)
    for k, a in enumerate(order):
        if not isinstance(design, HistoryDesign):
            recursion = modes_of(design, a, step=step, horizon=horizon).recursion()
            out[:, k] = (recursion.response(back).T * inputs).sum(axis=0)
        elif a in (0.0, 1.0):
            out[:, k] = inputs[int(a)]
        elif design.memory is not None:
            weights = design.coefficients(a, step=step, horizon=horizon)
            out[:, k] = np.polynomial.polynomial.polyval(back, weights)
        elif isinstance(design, GrunwaldLetnikov):
            out[:, k] = ((1.0 - back) / step) ** a  # the binomial series, summed
        else:
            # L1 over all of the past is what modes do with a rate that is not known.
            modes = modes_of(ExponentialSum(48), a, step=step, horizon=1e3 * horizon)
            out[:, k] = modes.recursion(measured=False).response(back)[:, 0]
    return out


def kernel_error(
    design: Design, order: FloatArray, lag: FloatArray, *, step: float, horizon: float
) -> FloatArray:
    """Return the relative error of the design's kernel at lags (k,) [s], (k, orders).

    The kernel stands for ``t^-alpha/Gamma(1 - alpha)``; it is the response to a unit step of the
    signal. That of the sum (1) is known at whole steps: its lags are rounded to them. Orders 0 and
    1 are exact.
    """
    inner = (order > 0.0) & (order < 1.0)
    alpha, t = np.where(inner, order, 0.5), lag[:, None]
    if isinstance(design, GrunwaldLetnikov):
        # The sum of the weights up to a lag, h^-alpha (-1)^j binom(alpha - 1, j).
        index = np.round(t / step)
        if design.memory is not None:
            index = np.minimum(index, design.lag_count(step, design.memory) - 1)
        found = step**-alpha * scipy.special.poch(index + 1.0, -alpha)
        found *= scipy.special.rgamma(1.0 - alpha)
    elif isinstance(design, HistoryDesign):
        # L1 integrates the kernel itself, as far as its memory reaches.
        found = t**-alpha * scipy.special.rgamma(1.0 - alpha)
        found[lag > (design.memory or np.inf)] = 0.0
    else:
        modes = modes_of(design, alpha, step=step, horizon=horizon)
        found = sum(w * np.exp(-t * p) for w, p in zip(modes.weights, modes.poles, strict=True))
    return np.where(inner, found * t**alpha * scipy.special.gamma(1.0 - alpha) - 1.0, 0.0)


def noise_gains(
    design: Design, order: FloatArray, *, step: float, horizon: float
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviation of the output for white noise of standard deviation one.

    Returns
    -------
    from_value, from_rate : ndarray
        For noise, independent from sample to sample, on the value [s^-alpha] and on the rate
        [s^(1-alpha)] alone, after one horizon; (orders,).
    """
    gains = np.zeros((2, order.size))
    for k, a in enumerate(order):
        if not isinstance(design, HistoryDesign):
            modes = modes_of(design, a, step=step, horizon=horizon)
            r = modes.recursion()
            second = r.before + r.weights @ r.drive_now
            # From then on each mode decays by exp(-p h) a sample: the sum of (sum_i c_i E_i^n)^2.
            later = r.weights[:, None] * (r.decay[:, None] * r.drive_now + r.drive_before)
            p = modes.poles[1 : 1 + r.decay.size] * step
            both = p[:, None] + p
            series = np.expm1(-(round(horizon / step) - 1) * both) / np.expm1(-both)
            tail = np.maximum((later * (series @ later)).sum(axis=0), 0.0)
            gains[:, k] = np.sqrt(r.now**2 + second**2 + tail)
        elif a in (0.0, 1.0):
            gains[int(a), k] = 1.0
        else:
            weights = design.coefficients(a, step=step, horizon=horizon)
            gains[0, k] = np.sqrt((weights**2).sum())
    return gains[0], gains[1]
