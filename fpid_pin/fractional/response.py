"""What a design does to a sinusoid, to a step and to noise, against the exact operator."""

from __future__ import annotations

import math
import warnings

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.fractional.design import Coefficients, Design, check_grid, check_order
from fpid_pin.fractional.history import GrunwaldLetnikov, HistoryDesign
from fpid_pin.fractional.rows import Rows, rows
from fpid_pin.fractional.special import gamma, gammaln, rgamma, zeta

ComplexArray = NDArray[np.complex128]


def frequency_response(
    design: Design,
    order: ArrayLike,
    frequency: ArrayLike,
    *,
    step: float,
    horizon: float,
    rate: str = "measured",
) -> ComplexArray:
    """Return the sampled operator's response to exp(j omega t), once its start has died away.

    The exact operator's is ``(j omega)^alpha``.

    Parameters
    ----------
    design
        Any design.
    order
        Orders alpha, (...).
    frequency
        Angular frequencies omega [rad/s], (k,), above 0 and up to pi/step.
    step, horizon
        Sampling step and fitted horizon [s].
    rate
        ``"measured"`` or ``"differenced"``, as in `Bank`.

    Returns
    -------
    ndarray
        Complex, (k, ...).
    """
    alpha = check_order(order)
    step, horizon = check_grid(step, horizon)
    measured = checks.choice("rate", rate, ("measured", "differenced")) == "measured"
    omega = checks.floats("frequency", frequency, above=0.0, high=math.pi / step * (1 + 1e-12))
    omega = omega.reshape(-1)
    flat = alpha.reshape(-1)
    back = np.exp(-1j * omega * step)[:, None]
    if isinstance(design, HistoryDesign):
        out = _lag_response(design, flat, back, step, horizon)
        if measured:
            out[:, flat == 1.0] = 1j * omega[:, None]
    else:
        r = modal_rows(design, flat, step=step, horizon=horizon, measured=measured)
        out = r.weights[0] + back * r.weights[2 if measured else 1]
        if measured:
            out = out + 1j * omega[:, None] * (r.weights[1] + back * r.weights[3])
        head = 4 if measured else 2
        for mode in range(r.decay.shape[0]):
            slope = 1j * omega[:, None] * r.sigma[mode] if measured else 0.0
            through = r.weights[head + mode] * (1.0 + slope) * back
            out = out + through / (1.0 - r.decay[mode] * back)
    out[:, flat == 0.0] = 1.0
    return np.asarray(out.reshape(omega.size, *alpha.shape))


def _lag_response(
    design: HistoryDesign, flat: FloatArray, back: ComplexArray, step: float, horizon: float
) -> ComplexArray:
    if design.memory is None and isinstance(design, GrunwaldLetnikov):
        return np.asarray(((1.0 - back) / step) ** flat)  # the binomial series, summed
    if design.memory is None:
        return _l1_response(flat, -np.log(back), step)
    count = design.lag_count(step, horizon)
    weights = design.weights(flat, count, step)
    out = np.zeros((back.size, flat.size), dtype=np.complex128)
    # Horner's rule in blocks: no array of (frequencies, lags) is ever held.
    block = 4096
    for start in range(0, count, block):
        part = weights[start : start + block]
        powers = back ** np.arange(start, start + len(part))
        out += powers @ part
    return out * (1.0 - back) if design.of_increments else out


def _l1_response(flat: FloatArray, angle: ComplexArray, step: float) -> ComplexArray:
    """Sum L1's series over all lags: ``(z - 1)(1 - 1/z) Li_(alpha-1)(1/z)``, 1/z = exp(-angle).

    The polylogarithm by its expansion at angle 0 (DLMF 25.12.12), which converges to 2 pi.
    """
    out = np.empty((angle.size, flat.size), dtype=np.complex128)
    back = np.exp(-angle[:, 0])
    for k, a in enumerate(flat):
        if a == 1.0:
            out[:, k] = (1.0 - back) / step
            continue
        total = gamma(2.0 - a) * angle[:, 0] ** (a - 2.0)
        for n in range(60):
            # zeta at a - 1 - n, by its reflection.
            s = a - 1.0 - n
            size = np.log(2.0 * math.pi) * s - math.log(math.pi) + gammaln(1.0 - s) - gammaln(n + 1)
            term = math.sin(0.5 * math.pi * s) * np.exp(size) * zeta(1.0 - s)
            total = total + term * (-angle[:, 0]) ** n
        out[:, k] = (1.0 / back - 1.0) * (1.0 - back) * total * step**-a * rgamma(2.0 - a)
    return out


def modal_rows(
    design: Design, flat: FloatArray, *, step: float, horizon: float, measured: bool
) -> Rows:
    """Return the row weights of a design with modes, one channel for each order."""
    c = design.coefficients(flat, step=step, horizon=horizon)
    if not isinstance(c, Coefficients):
        raise ArgumentError("design", "one with modes", type(design).__name__)
    return rows(c, measured=measured, from_rest=False, channels=flat.size)


def kernel(
    design: Design, order: ArrayLike, lag: ArrayLike, *, step: float, horizon: float
) -> FloatArray:
    """Return the design's kernel, which stands for ``t^-alpha/Gamma(1 - alpha)``, at some lags.

    It is the response to a unit step of the signal at `lag` after it.

    Parameters
    ----------
    design
        Any design. The sum (1) is known at whole steps: its lags are rounded to them.
    order
        Orders alpha, (...).
    lag
        Lags t [s], (k,), one step or longer.
    step, horizon
        Sampling step and fitted horizon [s].

    Returns
    -------
    ndarray
        (k, ...) [s^-alpha].
    """
    alpha = check_order(order)
    step, horizon = check_grid(step, horizon)
    t = checks.floats("lag", lag, low=0.0).reshape(-1)
    flat = alpha.reshape(-1)
    if isinstance(design, GrunwaldLetnikov):
        index = np.round(t / step).astype(int)
        count = max(design.lag_count(step, horizon), index.max() + 1)
        weights = design.weights(flat, count, step)
        weights[design.lag_count(step, max(horizon, t.max())) :] = 0.0
        found = np.cumsum(weights, axis=0)[index]
    elif isinstance(design, HistoryDesign):
        # L1 integrates the kernel itself, as far as its memory reaches.
        found = t[:, None] ** -flat * rgamma(1.0 - flat)
        if design.memory is not None:
            found[t > design.memory] = 0.0
    else:
        c = design.coefficients(flat, step=step, horizon=horizon)
        found = np.zeros((t.size, flat.size))
        for mode in range(c.poles.shape[0]):
            found += c.weights[mode] * np.exp(-t[:, None] * c.poles[mode])
    return np.asarray(found.reshape(t.size, *alpha.shape))


def kernel_error(
    design: Design, order: ArrayLike, lag: ArrayLike, *, step: float, horizon: float
) -> FloatArray:
    """Return the relative error of the kernel at some lags, (k, ...), orders inside (0, 1)."""
    alpha = check_order(order)
    found = kernel(design, alpha, lag, step=step, horizon=horizon)
    t = np.asarray(lag, dtype=np.float64).reshape((-1,) + (1,) * alpha.ndim)
    inner = (alpha > 0.0) & (alpha < 1.0)
    scale = t**alpha * gamma(np.where(inner, 1.0 - alpha, 1.0))
    return np.where(inner, found * scale - 1.0, 0.0)


def noise_gains(
    design: Design, order: ArrayLike, *, step: float, horizon: float, rate: str = "measured"
) -> tuple[FloatArray, FloatArray]:
    """Return the standard deviation of the output for white noise of standard deviation one.

    Parameters
    ----------
    design, order, step, horizon, rate
        As for `frequency_response`.

    Returns
    -------
    from_value, from_rate : ndarray
        For noise, independent from sample to sample, on the value [s^-alpha] and on the rate
        [s^(1-alpha)] alone, after one horizon; (...).
    """
    alpha = check_order(order)
    step, horizon = check_grid(step, horizon)
    flat = alpha.reshape(-1)
    samples = max(round(horizon / step), 2)
    measured = checks.choice("rate", rate, ("measured", "differenced")) == "measured"
    from_rate = np.zeros(flat.size)
    if isinstance(design, HistoryDesign):
        weights = design.weights(flat, design.lag_count(step, horizon), step)
        if design.of_increments:
            weights = np.diff(weights, axis=0, prepend=0.0)
        from_value = np.sqrt((weights**2).sum(axis=0))
        if measured:
            from_value[flat == 1.0], from_rate[flat == 1.0] = 0.0, 1.0
    else:
        r = modal_rows(design, flat, step=step, horizon=horizon, measured=measured)
        past = 2 if measured else 1
        from_value = np.empty(flat.size)
        for k in range(flat.size):
            shared = 0 if r.decay.shape[1] == 1 else k
            p = r.poles[:, shared] * step
            through = r.weights[2 * past :, k]
            from_value[k] = _deviation(r.weights[0, k], r.weights[past, k], through, p, samples)
            if measured:
                slope = through * r.sigma[:, shared]
                from_rate[k] = _deviation(r.weights[1, k], r.weights[3, k], slope, p, samples)
    from_value[flat == 0.0] = 1.0
    return from_value.reshape(alpha.shape), from_rate.reshape(alpha.shape)


def _deviation(
    now: float, before: float, modes: FloatArray, decades: FloatArray, samples: int
) -> float:
    """Return the root of the sum of squares of an impulse response.

    It is `now`, then `before` and the sum of `modes`, which then decay by exp(-decades) a sample.
    """
    rate = decades[:, None] + decades
    # From the second sample after the impulse: sum over k of (sum_i modes_i E_i^k)^2.
    later = np.exp(-rate) * -np.expm1(-(samples - 1) * rate) / -np.expm1(-rate)
    tail = (modes[:, None] * modes * later).sum()
    return math.sqrt(now**2 + (before + modes.sum()) ** 2 + max(float(tail), 0.0))


def warn_past_horizon(design: Design, order: FloatArray, *, step: float, horizon: float) -> None:
    """Warn that a bank runs past the horizon its design was fitted for; give the error."""
    lags = np.array([2.0 * horizon])
    inside = np.geomspace(step, horizon, 400)
    later = np.abs(kernel_error(design, order, lags, step=step, horizon=horizon)).max()
    before = np.abs(kernel_error(design, order, inside, step=step, horizon=horizon)).max()
    warnings.warn(
        f"the fractional bank runs past its horizon of {horizon:g} s: the kernel is within"
        f" {before:.1e} up to there and off by {later:.1e} at {2.0 * horizon:g} s",
        FpidWarning,
        stacklevel=5,
    )
