"""Measure a design: what an `OperatorReport` holds."""

from __future__ import annotations

import math
from functools import partial
from timeit import repeat, timeit

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, read_only
from fpid_pin.fractional.bank import Bank
from fpid_pin.fractional.crone import Oustaloup
from fpid_pin.fractional.design import DEFAULT_HORIZON, Design, check_grid, check_order, modes_of
from fpid_pin.fractional.history import HistoryDesign
from fpid_pin.fractional.operator_report import OperatorReport
from fpid_pin.fractional.response import frequency_response, kernel_error, noise_gains
from fpid_pin.fractional.special import rgamma

TRUSTED_WITHIN = 0.01


def report(
    design: Design, order: ArrayLike, *, step: float, horizon: float = DEFAULT_HORIZON
) -> OperatorReport:
    """Measure a design: see `OperatorReport`.

    Parameters
    ----------
    design
        Any design.
    order
        Orders alpha in [0, 1]; arrays are flattened.
    step, horizon
        Sampling step and horizon [s].

    Raises
    ------
    ArgumentError
        An order outside [0, 1], step <= 0, horizon <= step.
    DesignError
        A tolerance that cannot be met.
    """
    checks.instance("design", design, Design, "a fractional design")
    alpha = check_order(np.asarray(check_order(order)).reshape(-1))
    step, horizon = check_grid(step, horizon)
    nyquist = math.pi / step
    # Beyond the horizon on both scales: what can be trusted may reach further than was asked.
    omega = np.geomspace(min(1e-2 / horizon, 1e-3 * nyquist), nyquist, 600)
    response = frequency_response(design, alpha, omega, step=step, horizon=horizon)
    ratio = response / (1j * omega[:, None]) ** alpha
    band = _band(design, step, horizon)
    within = (omega >= band[0]) & (omega <= band[1])
    if not within.any():
        within[np.abs(np.log(omega / math.sqrt(band[0] * band[1]))).argmin()] = True
    inside = ratio[within]
    lag = np.geomspace(step, 30.0 * horizon, 1500)
    lag_error = kernel_error(design, alpha, lag, step=step, horizon=horizon)
    fitted = lag <= horizon
    low, high = _trusted_band(omega, np.abs(ratio - 1.0))
    from_value, from_rate = noise_gains(design, alpha, step=step, horizon=horizon)
    return OperatorReport(
        design=design,
        step=step,
        horizon=horizon,
        order=alpha,
        states=_states(design, step, horizon),
        band=band,
        magnitude_error=np.abs(20.0 * np.log10(np.abs(inside))).max(axis=0),
        phase_error=np.abs(np.degrees(np.angle(inside))).max(axis=0),
        kernel_error=np.abs(lag_error[fitted]).max(axis=0),
        error_bound=_error_bound(design, alpha, step, horizon),
        lowest_frequency=low,
        highest_frequency=high,
        longest_horizon=_trusted_lag(lag, np.abs(lag_error)),
        nyquist_gain=_nyquist_gain(design, alpha, step, horizon),
        noise_from_value=from_value,
        noise_from_rate=from_rate,
        cost=(_cost(design, alpha, 1, step), _cost(design, alpha, 240, step)),
        frequency=read_only(omega),
        response=response,
        lag=read_only(lag),
        lag_error=lag_error,
    )


def _band(design: Design, step: float, horizon: float) -> tuple[float, float]:
    nyquist = math.pi / step
    if isinstance(design, Oustaloup):
        return design.low, max(min(design.high, 0.5 * nyquist), design.low)
    low = 20.0 * math.pi / horizon
    return low, max(0.2 * nyquist, low)


def _states(design: Design, step: float, horizon: float) -> int:
    if isinstance(design, HistoryDesign):
        return design.lag_count(step, horizon)
    return len(modes_of(design, 0.5, step=step, horizon=horizon).poles) + 3


def _trusted_band(omega: FloatArray, error: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the ends of the widest band (on a log scale) within the limit, for each order."""
    low = np.full(error.shape[1], np.nan)
    high = low.copy()
    for k in range(error.shape[1]):
        good = error[:, k] <= TRUSTED_WITHIN
        edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
        if edges.size:
            starts, ends = edges[::2], edges[1::2] - 1
            widest = int(np.argmax(ends - starts))
            low[k], high[k] = omega[starts[widest]], omega[ends[widest]]
    return low, high


def _trusted_lag(lag: FloatArray, error: FloatArray) -> FloatArray:
    good = np.cumprod(error <= TRUSTED_WITHIN, axis=0).sum(axis=0)
    return np.where(good > 0, lag[good - 1], np.nan)


def _error_bound(design: Design, alpha: FloatArray, step: float, horizon: float) -> FloatArray:
    """Integrate the kernel's absolute error; in s = t^(1-alpha) the singular kernel is flat."""
    out = np.zeros(alpha.size)
    # The newest step is exact for designs that integrate it exactly, and not for a filter.
    start = 0.0 if isinstance(design, Oustaloup) else step
    for k, a in enumerate(alpha):
        if a in (0.0, 1.0):
            continue
        near = np.linspace(0.0, 1.0, 801)[1:] ** (1.0 / (1.0 - a)) * step
        near = np.maximum(near, 1e-200)
        far = np.geomspace(step, horizon, 4000)
        lag = far if start else np.concatenate([near[:-1], far])
        error = np.abs(kernel_error(design, a, lag, step=step, horizon=horizon))
        s = lag ** (1.0 - a)
        total = np.trapezoid(error, s) + (0.0 if start else error[0] * s[0])
        out[k] = total * rgamma(2.0 - a)
    return out


def _nyquist_gain(design: Design, alpha: FloatArray, step: float, horizon: float) -> FloatArray:
    """Response to a rate (-1)^k whose trapezoidal integral, the value, stays constant."""
    if isinstance(design, HistoryDesign):
        gain = np.zeros(alpha.size)  # these rules do not look at the rate,
        gain[alpha == 1.0] = 1.0  # but at order 1, where it is the output
        return gain
    modes = modes_of(design, alpha, step=step, horizon=horizon)
    alternating = np.array([-1.0 + 0.0j])
    response = [modes.recursion(k).response(alternating)[0, 1] for k in range(alpha.size)]
    return np.abs(response)


def _cost(design: Design, alpha: FloatArray, signals: int, step: float) -> float:
    """Time `Bank.update`, in seconds a call: the least of some short runs."""
    order = np.resize(alpha, signals)
    # A short horizon: the past that a reference rule keeps does not grow while it is timed.
    bank = Bank(design, order, step=step, horizon=1000.0 * step)
    value, rate = np.sin(np.arange(signals)), np.cos(np.arange(signals))
    call = partial(bank.update, value, rate, np.empty(signals))
    timeit(call, number=20)
    return min(repeat(call, number=40, repeat=5)) / 40
