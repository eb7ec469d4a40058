"""What a design does to a sinusoid, to a step and to noise, against the exact operator."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.fractional.design import Design, check_grid, check_order, modes_of
from fpid_pin.fractional.history import GrunwaldLetnikov, HistoryDesign
from fpid_pin.fractional.modes import ComplexArray, Modes
from fpid_pin.fractional.special import gamma, gammaln, rgamma, zeta


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
    back = np.exp(-1j * omega * step)
    if isinstance(design, HistoryDesign):
        out = _lag_response(design, flat, back[:, None], step, horizon)
        if measured:
            out[:, flat == 1.0] = 1j * omega[:, None]
        out[:, flat == 0.0] = 1.0
    else:
        modes = modes_of(design, flat, step=step, horizon=horizon)
        # Of f = exp(j omega t) the rate is j omega f.
        inputs = np.stack([np.ones_like(back), 1j * omega], axis=1) if measured else 1.0
        out = np.empty((omega.size, flat.size), dtype=np.complex128)
        for k in range(flat.size):
            response = modes.recursion(k, measured=measured).response(back)
            out[:, k] = (response * inputs).sum(axis=1)
    return out.reshape(omega.size, *alpha.shape)


def _lag_response(
    design: HistoryDesign, flat: FloatArray, back: ComplexArray, step: float, horizon: float
) -> ComplexArray:
    if design.memory is None and isinstance(design, GrunwaldLetnikov):
        return np.asarray(((1.0 - back) / step) ** flat)  # the binomial series, summed
    if design.memory is None:
        return _l1_response(flat, -np.log(back), step)
    lags = design.coefficients(flat, step=step, horizon=horizon)
    out = np.zeros((back.size, flat.size), dtype=np.complex128)
    # In blocks: no array of (frequencies, lags) is ever held.
    block = 4096
    for start in range(0, len(lags.weights), block):
        part = lags.weights[start : start + block]
        out += back ** np.arange(start, start + len(part)) @ part
    return out * (1.0 - back) + lags.level


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
        longest = max(horizon, step * float(index.max()))
        lags = design.coefficients(flat, step=step, horizon=longest)
        within = (index < len(lags.weights))[:, None]
        found = np.where(within, lags.weights[index % len(lags.weights)], 0.0) + lags.level
    elif isinstance(design, HistoryDesign):
        # L1 integrates the kernel itself, as far as its memory reaches.
        found = t[:, None] ** -flat * rgamma(1.0 - flat)
        if design.memory is not None:
            found[t > design.memory] = 0.0
    else:
        modes = modes_of(design, flat, step=step, horizon=horizon)
        found = np.zeros((t.size, flat.size))
        for weights, poles in zip(modes.weights, modes.poles, strict=True):
            found += weights * np.exp(-t[:, None] * poles)
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
    measured = checks.choice("rate", rate, ("measured", "differenced")) == "measured"
    gains = np.zeros((2, flat.size))
    if isinstance(design, HistoryDesign):
        lags = design.coefficients(flat, step=step, horizon=horizon)
        weights = np.diff(lags.weights, axis=0, prepend=0.0)
        weights[0] += lags.level
        gains[0] = np.sqrt((weights**2).sum(axis=0))
        gains[0, flat == 0.0] = 1.0
        if measured:
            gains[:, flat == 1.0] = [[0.0], [1.0]]
    else:
        modes = modes_of(design, flat, step=step, horizon=horizon)
        samples = max(round(horizon / step), 2)
        for k in range(flat.size):
            gains[: 2 if measured else 1, k] = _deviations(modes, k, measured, samples)
    return gains[0].reshape(alpha.shape), gains[1].reshape(alpha.shape)


def _deviations(modes: Modes, k: int, measured: bool, samples: int) -> FloatArray:
    """Return the root of the sum of squares of the impulse response to each input of one order."""
    r = modes.recursion(k, measured=measured)
    second = r.before + r.weights @ r.drive_now
    # From then on each mode decays by exp(-p h) a sample: sum over n of (sum_i c_i E_i^n)^2.
    later = r.weights[:, None] * (r.decay[:, None] * r.drive_now + r.drive_before)
    poles = modes.poles if modes.shared_poles else modes.poles[:, k]
    p = poles[1 : 1 + r.decay.size] * modes.step
    both = p[:, None] + p
    series = np.expm1(-(samples - 1) * both) / np.expm1(-both)
    tail = np.maximum((later * (series @ later)).sum(axis=0), 0.0)
    return np.asarray(np.sqrt(r.now**2 + second**2 + tail))
