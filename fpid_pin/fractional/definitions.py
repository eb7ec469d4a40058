"""Fractional derivatives of a recorded signal by their definitions: equations (1), (2), (4).

For orders alpha in (0, 1), on samples f_0 ... f_(N-1) a step h apart, with the lower limit at the
first one:

(1)  Grünwald-Letnikov: the sum itself, ``h^-alpha sum_j (-1)^j binom(alpha, j) f_(k-j)``
(4)  Caputo: the integral of the rate against t^-alpha/Gamma(1 - alpha)
(2)  Riemann-Liouville: Caputo's plus ``f(0) t^-alpha/Gamma(1 - alpha)``

The sum is the definition of (1) for the given step. (2) and (4) are integrals of the rate: where it
is not known, the whole record being there, it is that of a quintic spline through the samples.
Designs with modes give what a `Bank` gives sample by sample. The two that sum over the whole past
are here, for recorded signals alone, by FFT.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, checked, read_only
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.bank import Bank
from fpid_pin.fractional.design import INITIALISATIONS, Design, check_grid, check_order
from fpid_pin.fractional.exponential_sum import ExponentialSum

_KERNEL_TOLERANCE = 1e-10
_SPLINE_DEGREE = 5


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
            raise ArgumentError("rate", f"shape {f.shape}", f"shape {rate.shape}")
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
    """Caputo's integral (4) with the rate constant on every step; order 2 - alpha in the step.

    ``h^-alpha/Gamma(2 - alpha) sum_j ((j + 1)^(1-alpha) - j^(1-alpha)) (f_(k-j) - f_(k-j-1))``
    (Oldham and Spanier, *The Fractional Calculus*, 1974).
    """

    def _weights(self, order: FloatArray, lag: FloatArray) -> FloatArray:
        """Return the differences of ((j + 1)^(1-alpha) - j^(1-alpha))/Gamma(2 - alpha)."""
        power = 1.0 - order
        # The difference of two nearly equal powers, without subtracting them.
        tail = lag**power * np.expm1(power * np.log1p(1.0 / lag))
        weights = np.concatenate([np.ones((1, *order.shape)), tail])
        return np.asarray(np.diff(weights, axis=0, prepend=0.0) * scipy.special.rgamma(1.0 + power))


@checked
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
        Sampling step h [s].
    rate
        Samples of the signal's rate, where it is known.
    axis
        Axis of time.
    initialisation
        ``"caputo"``: the signal had been f(0) for ever, and the first sample gives 0.
        ``"riemann_liouville"`` and ``"grunwald_letnikov"`` are explained at `Bank`.
    design
        How. None: an exponential sum within 1e-10 of the kernel and, where no rate is given, that
        of a quintic spline (of lower degree below 6 samples). Any design may be given; with modes
        it takes a rate that is not known for constant between samples, which is the L1 rule.
        `L1` is that rule over the whole past, by FFT.

    Returns
    -------
    ndarray
        Of the shape of `signal`. Order 0 gives the signal, order 1 its rate.

    Raises
    ------
    ArgumentError
        NaN or infinity in the signal (it says where), fewer than two samples, an order outside
        [0, 1], shapes that do not fit.

    Notes
    -----
    At 1 ms over 20 s and order 0.87 the largest error over the largest value is 2e-12 for sin t
    and 3e-9 for t^2.3 (L1: 2e-4, 8e-6). What is singular at t = 0 stays limited by its first
    samples: 3e-4 for t^1.2 (L1: 5e-3), 0.11 for t^0.5 (L1: 0.7); 1e-10 and 4e-8 after one second.

    White noise of standard deviation one on the samples leaves 1.06, 1.16, 1.28 h^-alpha at orders
    0.2, 0.5, 0.87 (L1: 1.12, 1.31, 1.43), but some 10 h^-alpha in the last sample and 3 in the one
    before it (order 0.87): at its ends the spline has samples on one side only.
    """
    step = checks.number("step", step, above=0.0)
    value = _time_first("signal", signal, axis)
    known_rate = None if rate is None else _time_first("rate", rate, axis)
    alpha = check_order(order)
    try:
        alpha = read_only(np.broadcast_to(alpha, value.shape[1:]))
    except ValueError:
        expected = f"a shape that broadcasts to {value.shape[1:]}"
        raise ArgumentError("order", expected, f"shape {alpha.shape}") from None
    if design is None:
        design = ExponentialSum(tolerance=_KERNEL_TOLERANCE)
        if known_rate is None:
            at = np.arange(float(len(value)))
            degree = min(_SPLINE_DEGREE, len(value) - 1)
            spline = scipy.interpolate.make_interp_spline(at, value, k=degree)
            known_rate = np.asarray(spline.derivative()(at)) / step
    if isinstance(design, HistorySum):
        out = design.recorded(value, known_rate, alpha, step, initialisation)
        return np.moveaxis(out, 0, axis)
    horizon = max(len(value) - 1, 2) * step
    bank = Bank(design, alpha, step=step, horizon=horizon, initialisation=initialisation)
    return np.moveaxis(bank.recorded(value, known_rate), 0, axis)


def riemann_liouville(
    signal: ArrayLike, order: ArrayLike, step: float, **options: Any
) -> FloatArray:
    """Riemann-Liouville derivative of a recorded signal, equation (2).

    It is Caputo's plus ``f(0) t^-alpha/Gamma(1 - alpha)``. At the first sample that is infinite
    and left out.

    Parameters
    ----------
    signal, order, step
        See `caputo`, also for what is returned and raised.
    **options
        `rate`, `axis`, `design`, and `initialisation`, here ``"riemann_liouville"``: see `caputo`.
    """
    return caputo(signal, order, step, **{"initialisation": "riemann_liouville"} | options)


def grunwald_letnikov(
    signal: ArrayLike, order: ArrayLike, step: float, **options: Any
) -> FloatArray:
    """Grünwald-Letnikov derivative of a recorded signal: the sum (1) for the given step.

    The first sample gives ``f(0) h^-alpha``.

    Parameters
    ----------
    signal, order, step
        See `caputo`, also for what is returned and raised.
    **options
        `rate` and `axis`, `design`, here `GrunwaldLetnikov`, and `initialisation`, here
        ``"grunwald_letnikov"``: see `caputo`. A `rate` serves order 1, and a design that uses it.
    """
    if options.get("design") is None:
        options["design"] = GrunwaldLetnikov()
    return caputo(signal, order, step, **{"initialisation": "grunwald_letnikov"} | options)


def _time_first(name: str, array: ArrayLike, axis: int) -> FloatArray:
    values = checks.floats(name, array)
    if not -values.ndim <= axis < values.ndim:
        raise ArgumentError("axis", f"an axis of {name} (shape {values.shape})", axis)
    values = np.moveaxis(values, axis, 0)
    if len(values) < 2:
        raise ArgumentError(name, "at least 2 samples", len(values))
    return values
