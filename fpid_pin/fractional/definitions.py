"""Fractional derivatives of a recorded signal by their definitions: equations (1), (2), (4).

For orders alpha in (0, 1), on samples f_0 ... f_(N-1) a step h apart, with the lower limit at the
first one:

(1)  Grünwald-Letnikov: the sum itself, ``h^-alpha sum_j (-1)^j binom(alpha, j) f_(k-j)``
(4)  Caputo: the integral of the rate against t^-alpha/Gamma(1 - alpha)
(2)  Riemann-Liouville: Caputo's plus ``f(0) t^-alpha/Gamma(1 - alpha)``

Sums over the whole past are made by FFT, in O(N log N).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, read_only
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.bank import INITIALISATIONS
from fpid_pin.fractional.design import Design
from fpid_pin.fractional.exponential_sum import ExponentialSum
from fpid_pin.fractional.history import L1, GrunwaldLetnikov, HistoryDesign
from fpid_pin.fractional.recorded import run_modes
from fpid_pin.fractional.special import rgamma

_RATE_TOLERANCE = 1e-10


def caputo(
    signal: ArrayLike,
    order: ArrayLike,
    step: float,
    *,
    rate: ArrayLike | None = None,
    axis: int = -1,
    initialisation: str = "caputo",
    design: Design | None = None,
) -> FloatArray:
    """Caputo derivative of a recorded signal, equation (4) with Gamma(n - alpha).

    Parameters
    ----------
    signal
        Samples, any shape, time along `axis`.
    order
        Orders alpha in [0, 1], broadcastable to the shape of `signal` without `axis`.
    step
        Sampling step [s].
    rate
        Samples of the signal's rate, where it is known: far more accurate.
    axis
        Axis of time.
    initialisation
        ``"caputo"``: the signal had been f(0) for ever, and the first sample gives 0.
        ``"riemann_liouville"`` and ``"grunwald_letnikov"`` are explained at `Bank`.
    design
        How. None is the L1 rule over the whole past by FFT, or, where the rate is known, an
        exponential sum within 1e-10 of the kernel. Any design may be given.

    Returns
    -------
    ndarray
        Of the shape of `signal`. Order 0 gives the signal, order 1 its rate.

    Raises
    ------
    ArgumentError
        NaN or infinity in the signal (it says where), fewer than two samples, an order outside
        [0, 1], shapes that do not fit.
    """
    return _derivative(L1(), signal, order, step, rate, axis, initialisation, design)


def riemann_liouville(
    signal: ArrayLike,
    order: ArrayLike,
    step: float,
    *,
    rate: ArrayLike | None = None,
    axis: int = -1,
    initialisation: str = "riemann_liouville",
    design: Design | None = None,
) -> FloatArray:
    """Riemann-Liouville derivative of a recorded signal, equation (2).

    It is Caputo's plus ``f(0) t^-alpha/Gamma(1 - alpha)``. At the first sample that is infinite
    and left out. Parameters, results and errors are those of `caputo`.

    Parameters
    ----------
    signal, order, step, rate, axis, initialisation, design
        See `caputo`.

    Returns
    -------
    ndarray
        Of the shape of `signal`.
    """
    return _derivative(L1(), signal, order, step, rate, axis, initialisation, design)


def grunwald_letnikov(
    signal: ArrayLike,
    order: ArrayLike,
    step: float,
    *,
    rate: ArrayLike | None = None,
    axis: int = -1,
    initialisation: str = "grunwald_letnikov",
    design: Design | None = None,
) -> FloatArray:
    """Grünwald-Letnikov derivative of a recorded signal: the sum (1) for the given step.

    The first sample gives ``f(0) h^-alpha``. Parameters, results and errors are those of
    `caputo`.

    Parameters
    ----------
    signal, order, step, rate, axis, initialisation, design
        See `caputo`; `rate` serves order 1, and a `design` that uses it.

    Returns
    -------
    ndarray
        Of the shape of `signal`.
    """
    return _derivative(GrunwaldLetnikov(), signal, order, step, rate, axis, initialisation, design)


def _derivative(
    rule: HistoryDesign,
    signal: ArrayLike,
    order: ArrayLike,
    step: float,
    rate: ArrayLike | None,
    axis: int,
    initialisation: str,
    design: Design | None,
) -> FloatArray:
    step = checks.number("step", step, above=0.0)
    checks.choice("initialisation", initialisation, INITIALISATIONS)
    value = _time_first("signal", signal, axis, step)
    slope = None if rate is None else _time_first("rate", rate, axis, step)
    if slope is not None and slope.shape != value.shape:
        raise ArgumentError("rate", f"shape {value.shape}", f"shape {slope.shape} (time first)")
    alpha = checks.floats("order", order, low=0.0, high=1.0)
    try:
        alpha = read_only(np.broadcast_to(alpha, value.shape[1:]))
    except ValueError:
        expected = f"a shape that broadcasts to {value.shape[1:]}"
        raise ArgumentError("order", expected, f"shape {alpha.shape}") from None
    if design is None:
        by_rate = slope is not None and isinstance(rule, L1)
        design = ExponentialSum(tolerance=_RATE_TOLERANCE) if by_rate else rule
    checks.instance("design", design, Design, "a fractional design")
    if isinstance(design, HistoryDesign):
        result = _convolve(design, alpha, value, slope, step, initialisation)
    else:
        result = run_modes(design, alpha, value, slope, step=step, initialisation=initialisation)
    return np.moveaxis(result, 0, axis)


def _time_first(name: str, array: ArrayLike, axis: int, step: float) -> FloatArray:
    try:
        values = np.asarray(array, dtype=np.float64)
    except (TypeError, ValueError):
        raise ArgumentError(name, "an array of numbers", repr(array)) from None
    if not -values.ndim <= axis < values.ndim:
        raise ArgumentError("axis", f"an axis of {name} (shape {values.shape})", axis)
    values = np.moveaxis(values, axis, 0)
    if values.shape[0] < 2 or values.size == 0:
        raise ArgumentError(name, "at least 2 samples", values.shape[0])
    if not np.isfinite(values).all():
        index = tuple(int(i) for i in np.argwhere(~np.isfinite(values))[0])
        channel = f", channel {index[1:]}" if len(index) > 1 else ""
        where = f"sample {index[0]} (t = {index[0] * step:g} s){channel}"
        raise ArgumentError(name, "finite numbers", f"{values[index]} at {where}")
    return values


def _convolve(
    rule: HistoryDesign,
    alpha: FloatArray,
    value: FloatArray,
    rate: FloatArray | None,
    step: float,
    initialisation: str,
) -> FloatArray:
    samples = value.shape[0]
    weights = rule.weights(alpha, min(samples, rule.lag_count(step, samples * step)), step)
    first = value[0]
    from_rest = initialisation == "grunwald_letnikov"
    inner = (alpha > 0.0) & (alpha < 1.0)
    if rule.of_increments:
        past = np.diff(value, axis=0, prepend=first[None])
    else:
        past = value if from_rest else value - first
    # Imported late, as all of SciPy is.
    from scipy import fft

    size = fft.next_fast_len(samples + len(weights) - 1, real=True)
    spectrum = fft.rfft(past, size, axis=0) * fft.rfft(weights, size, axis=0)
    out = fft.irfft(spectrum, size, axis=0)[:samples]
    if initialisation != "caputo" and (rule.of_increments or not from_rest):
        t = np.arange(1, samples).reshape((-1,) + (1,) * alpha.ndim) * step
        out[1:] += np.where(inner, first * t**-alpha * rgamma(1.0 - alpha), 0.0)
    # The first sample is known exactly; a transform would leave rounding there.
    out[0] = np.where(alpha > 0.0, first * step**-alpha, 0.0) if from_rest else 0.0
    if rate is not None:
        np.copyto(out, rate, where=alpha == 1.0)
    np.copyto(out, value, where=alpha == 0.0)
    return np.asarray(out)
