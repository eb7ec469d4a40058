"""A design's errors, gains and cost in one table."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, read_only
from fpid_pin.fractional.crone import Oustaloup
from fpid_pin.fractional.design import Design, check_grid, check_order
from fpid_pin.fractional.history import HistoryDesign
from fpid_pin.fractional.response import (
    ComplexArray,
    frequency_response,
    kernel_error,
    modal_rows,
    noise_gains,
)
from fpid_pin.fractional.special import rgamma

TRUSTED_WITHIN = 0.01


@dataclass(frozen=True, eq=False)
class Report:
    """How far a design can be trusted, for each of its orders; prints as a table.

    All arrays are (orders,) unless another shape is given.

    Attributes
    ----------
    design, step, horizon
        What was measured; step and horizon in s.
    order
        Orders alpha.
    states
        Numbers kept for each signal: modes and newest samples, or the past that is kept.
    band
        The band [rad/s] of the next two: a CRONE design's own, as far as half of the Nyquist
        frequency; otherwise ten periods within the horizon to a fifth of the Nyquist frequency.
    magnitude_error, phase_error
        Largest deviation from (j omega)^alpha in the band [dB], [degree].
    kernel_error
        Largest relative error of the kernel for lags in [step, horizon].
    error_bound
        Integral of the kernel's absolute error over the horizon: no output is further off than
        this times the largest rate of the signal [s^(1-alpha)]. (What the rule between samples
        adds is not in it.)
    lowest_frequency, highest_frequency
        Where the response is within 1 % of (j omega)^alpha [rad/s]; NaN where nowhere.
    longest_horizon
        Up to which lag the kernel is within 1 % [s]; NaN where not even at one step.
    nyquist_gain
        Output for a unit rate that changes sign at every sample, the value agreeing with it:
        1 at order 1. It limits the derivative gain of a sampled loop.
    noise_from_value, noise_from_rate
        Standard deviation of the output for white noise of standard deviation one on the value
        [s^-alpha] and on the rate [s^(1-alpha)].
    cost
        Seconds for one sample of one signal and of 240 signals at once, measured.
    frequency, response
        The curves: (k,) [rad/s] and complex (k, orders).
    lag, lag_error
        (l,) [s] and the kernel's relative error there (l, orders).
    """

    design: Design
    step: float
    horizon: float
    order: FloatArray
    states: int
    band: tuple[float, float]
    magnitude_error: FloatArray
    phase_error: FloatArray
    kernel_error: FloatArray
    error_bound: FloatArray
    lowest_frequency: FloatArray
    highest_frequency: FloatArray
    longest_horizon: FloatArray
    nyquist_gain: FloatArray
    noise_from_value: FloatArray
    noise_from_rate: FloatArray
    cost: tuple[float, float]
    frequency: FloatArray = field(repr=False)
    response: ComplexArray = field(repr=False)
    lag: FloatArray = field(repr=False)
    lag_error: FloatArray = field(repr=False)

    def __str__(self) -> str:
        one, many = self.cost
        head = [
            f"{self.design}, step {self.step:g} s, horizon {self.horizon:g} s,"
            f" {self.states} numbers a signal",
            f"cost of a sample: {one * 1e6:.1f} us for one signal,"
            f" {many / 240 * 1e9:.0f} ns a signal for 240",
            f"magnitude and phase over {self.band[0]:.3g} .. {self.band[1]:.3g} rad/s;"
            " trusted: within 1 %; noise: output for one unit a sample",
        ]
        titles = (
            ("order", "", "8"),
            ("magnitude", "dB", "10"),
            ("phase", "deg", "10"),
            ("kernel", "relative", "10"),
            ("bound", "of |f'|", "10"),
            ("trusted", "from rad/s", "11"),
            ("trusted", "to rad/s", "10"),
            ("trusted", "to s", "10"),
            ("Nyquist", "gain", "9"),
            ("noise", "from f", "9"),
            ("noise", "from f'", "9"),
        )
        columns = (
            self.magnitude_error,
            self.phase_error,
            self.kernel_error,
            self.error_bound,
            self.lowest_frequency,
            self.highest_frequency,
            self.longest_horizon,
            self.nyquist_gain,
            self.noise_from_value,
            self.noise_from_rate,
        )
        lines = [
            "".join(f"{title:>{width}}" for title, _, width in titles),
            "".join(f"{unit:>{width}}" for _, unit, width in titles),
        ]
        for row, order in enumerate(self.order):
            cells = [f"{order:>8.4g}"]
            for (_, _, width), column in zip(titles[1:], columns, strict=True):
                cells.append(f"{column[row]:>{width}.2g}")
            lines.append("".join(cells))
        return "\n".join(head + lines)

    def plot(self, path: str | Path | None = None) -> Any:
        """Draw magnitude, phase and kernel errors; write the figure to `path` if one is given.

        Returns
        -------
        matplotlib.figure.Figure
        """
        from fpid_pin.fractional.plots import plot_report

        return plot_report(self, path)


def report(design: Design, order: ArrayLike, *, step: float, horizon: float) -> Report:
    """Measure a design: see `Report`.

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
    exact = (1j * omega[:, None]) ** alpha
    ratio = response / exact
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
    return Report(
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
    return int(design.coefficients(0.5, step=step, horizon=horizon).poles.shape[0]) + 3


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
    out = np.full(error.shape[1], np.nan)
    for k in range(error.shape[1]):
        bad = np.flatnonzero(error[:, k] > TRUSTED_WITHIN)
        last = bad[0] - 1 if bad.size else lag.size - 1
        if last >= 0:
            out[k] = lag[last]
    return out


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
    r = modal_rows(design, alpha, step=step, horizon=horizon, measured=True)
    modes = r.weights[4:] * r.sigma / (1.0 + r.decay)
    return np.asarray(np.abs(r.weights[1] - r.weights[3] - modes.sum(axis=0)))


def _cost(design: Design, alpha: FloatArray, signals: int, step: float) -> float:
    """Time `Bank.update`, in seconds a call: the least of some short runs."""
    order = np.resize(alpha, signals)
    # A short horizon: the past that a reference rule keeps does not grow while it is timed.
    bank = design.bank(order, step=step, horizon=1000.0 * step)
    value, rate = np.sin(np.arange(signals)), np.cos(np.arange(signals))
    out = np.empty(signals)
    for _ in range(20):
        bank.update(value, rate, out)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        for _ in range(40):
            bank.update(value, rate, out)
        times.append((time.perf_counter() - begin) / 40)
    return min(times)
