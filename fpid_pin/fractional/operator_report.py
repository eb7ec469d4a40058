"""A design's errors, gains and cost, against the exact operator, and it as a linear system."""

import math
from functools import partial
from pathlib import Path
from timeit import repeat, timeit
from typing import Any

import numpy as np
import scipy
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray, checked
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import replacing
from fpid_pin.fractional.bank import Bank
from fpid_pin.fractional.crone import Crone
from fpid_pin.fractional.design import (
    DEFAULT_HORIZON,
    Design,
    Modes,
    check_grid,
    check_order,
    integrate_step,
    modes_of,
)
from fpid_pin.fractional.exponential_sum import ExponentialSum
from fpid_pin.text import ReprMixin

TRUSTED_WITHIN = 0.01

#: The table's columns: attribute, title, what its numbers are.
_COLUMNS = (
    ("magnitude_error", "magnitude", "dB"),
    ("phase_error", "phase", "deg"),
    ("kernel_error", "kernel", "relative"),
    ("error_bound", "bound", "of |f'|"),
    ("lowest_frequency", "trusted", "from rad/s"),
    ("highest_frequency", "trusted", "to rad/s"),
    ("longest_horizon", "trusted", "to s"),
    ("nyquist_gain", "Nyquist", "gain"),
    ("noise_from_value", "noise", "from f"),
    ("noise_from_rate", "noise", "from f'"),
)


class OperatorReport(ReprMixin):
    """How far a design can be trusted, order by order; prints as a table. `report` for short.

    Parameters
    ----------
    design
        One with modes.
    order
        Orders alpha in [0, 1]; arrays are flattened.
    step, horizon
        Sampling step and horizon [s].

    Attributes
    ----------
    design, step, horizon, order
        What was measured. All arrays are (orders,) unless another shape is given.
    states
        Numbers kept for each signal: modes and newest samples.
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

    Raises
    ------
    ArgumentError
        An order outside [0, 1], step <= 0, horizon <= step, a design without modes.
    DesignError
        A tolerance that cannot be met.
    """

    def __init__(
        self, design: Design, order: ArrayLike, *, step: float, horizon: float = DEFAULT_HORIZON
    ) -> None:
        self.design, self.order = design, check_order(order).reshape(-1)
        self.step, self.horizon = check_grid(step, horizon)
        modes = self._modes(self.order)
        nyquist = math.pi / self.step
        # Beyond the horizon on both scales: what can be trusted may reach further than was asked.
        lowest = min(1e-2 / self.horizon, 1e-3 * nyquist)
        self.frequency = omega = np.geomspace(lowest, nyquist, 600)
        self.response = modes.response(omega)
        self.lag = np.geomspace(self.step, 30.0 * self.horizon, 1500)
        self.lag_error = modes.kernel_error(self.lag)
        low, high = 20.0 * math.pi / self.horizon, 0.2 * nyquist
        if isinstance(design, Crone):
            low, high = design.low, min(design.high, 0.5 * nyquist)
        self.band = (low, max(low, high))
        inside = (omega >= self.band[0]) & (omega <= self.band[1])
        if not inside.any():
            inside[np.abs(np.log(omega / math.sqrt(self.band[0] * self.band[1]))).argmin()] = True
        decibel, degrees = self._deviation()
        self.magnitude_error = np.abs(decibel[inside]).max(axis=0)
        self.phase_error = np.abs(degrees[inside]).max(axis=0)
        self.kernel_error = np.abs(self.lag_error[self.lag <= self.horizon]).max(axis=0)
        self.error_bound = np.array([self._error_bound(a) for a in self.order])
        exact = (1j * omega[:, None]) ** self.order
        trusted = np.abs(self.response / exact - 1.0) <= TRUSTED_WITHIN
        ends = [omega[_longest(column)] for column in trusted.T]
        self.lowest_frequency = np.array([e[0] if e.size else np.nan for e in ends])
        self.highest_frequency = np.array([e[-1] if e.size else np.nan for e in ends])
        reach = np.cumprod(np.abs(self.lag_error) <= TRUSTED_WITHIN, axis=0).sum(axis=0)
        self.longest_horizon = np.where(reach > 0, self.lag[reach - 1], np.nan)
        self.noise_from_value, self.noise_from_rate = modes.noise_gains(self.horizon)
        self.states = len(modes.poles) + 3
        back, each = (
            np.array([-1.0 + 0.0j]),
            [modes.recursion((k,)) for k in range(modes.order.size)],
        )
        self.nyquist_gain = np.abs([recursion.response(back)[0, 1] for recursion in each])
        self.cost = (self._time(1), self._time(240))

    def _modes(self, order: ArrayLike) -> Modes:
        return modes_of(self.design, order, step=self.step, horizon=self.horizon)

    def _deviation(self) -> tuple[FloatArray, FloatArray]:
        """Return the response's distance from (j omega)^alpha [dB], [degree], (k, orders) each."""
        ratio = self.response / (1j * self.frequency[:, None]) ** self.order
        decibel = 20.0 * np.log10(np.maximum(np.abs(ratio), 1e-300))
        return decibel, np.degrees(np.angle(ratio))

    def _error_bound(self, order: float) -> float:
        """Integrate the kernel's absolute error; in s = t^(1-alpha) the singular kernel is flat."""
        if order in (0.0, 1.0):
            return 0.0
        lag = np.geomspace(self.step, self.horizon, 4000)
        # Most designs integrate the newest step exactly, a filter does not.
        if isinstance(self.design, Crone):
            near = np.linspace(0.0, 1.0, 801)[1:-1] ** (1.0 / (1.0 - order)) * self.step
            lag = np.concatenate([np.maximum(near, 1e-200), lag])
        error = np.abs(self._modes(order).kernel_error(lag))
        s = lag ** (1.0 - order)
        first = error[0] * s[0] if isinstance(self.design, Crone) else 0.0
        return float((np.trapezoid(error, s) + first) * scipy.special.rgamma(2.0 - order))

    def _time(self, signals: int) -> float:
        """Time `Bank.update`, in seconds a call: the least of some short runs."""
        order = np.resize(self.order, signals)
        bank = Bank(self.design, order, step=self.step, horizon=self.horizon)
        value, rate = np.sin(np.arange(signals)), np.cos(np.arange(signals))
        call = partial(bank.update, value, rate, np.empty(signals))
        timeit(call, number=20)
        return min(repeat(call, number=40, repeat=5)) / 40

    @property
    def heading(self) -> list[str]:
        """What was measured and what a sample costs, in lines."""
        one, many = self.cost
        return [
            f"Fractional derivatives by {self._design_in_words()}, for steps of {self.step:g} s "
            f"and up to {self.horizon:g} s; {self.states} numbers are kept for each signal.",
            f"A sample takes {one * 1e6:.1f} us for one signal, and {many / 240 * 1e9:.0f} ns for "
            "each of 240 at once.",
            "Magnitude and phase: the largest errors from "
            f"{self.band[0]:.3g} to {self.band[1]:.3g} rad/s. Trusted: where the error is within "
            "1 %. Noise: standard deviation of the output for samples with deviation 1.",
        ]

    def _design_in_words(self) -> str:
        design = self.design
        if isinstance(design, Crone):
            band = f"from {design.low:g} to {design.high:g} rad/s"
            wider = f", widened by {design.widening:g} decades" if design.widening else ""
            return f"a CRONE filter of order {2 * design.n + 1} {band}{wider}"
        if isinstance(design, ExponentialSum):
            wanted = design.tolerance
            enough = "" if wanted is None else f", enough for an accuracy of {wanted:g}"
            return f"a sum of {self.states - 3} exponentials{enough}"
        return repr(design)

    @property
    def rows(self) -> list[dict[str, float]]:
        """The table: a row for each order, by the columns' heads; numbers have two digits."""
        return [
            {"order": float(order)}
            | {f"{title} [{unit}]": float(f"{getattr(self, name)[k]:.2g}")
               for name, title, unit in _COLUMNS}
            for k, order in enumerate(self.order)
        ]  # fmt: skip

    def __str__(self) -> str:
        # The order has two lines of head too.
        heads = [("order", ""), *((title, unit) for _, title, unit in _COLUMNS)]
        cells = [[f"{value:.4g}" for value in row.values()] for row in self.rows]
        table = [*zip(*heads, strict=True), *cells]
        return "\n".join([*self.heading, *("".join(f"{x:>11}" for x in row) for row in table)])

    @checked
    def plot(self, path: str | Path | None = None) -> Any:
        """Draw magnitude and phase errors against frequency, and the kernel's against lag.

        Parameters
        ----------
        path
            File to write, by its suffix, whole or not at all; None writes none.

        Returns
        -------
        matplotlib.figure.Figure
        """
        # Imported late: it is the heaviest import of all.
        from matplotlib.figure import Figure

        figure = Figure(figsize=(8.0, 9.0), layout="constrained")
        axes = figure.subplots(3, 1)
        decibel, degrees = self._deviation()
        frequency, lag = "angular frequency [rad/s]", "lag [s]"
        for ax, at, error, along, what, band in (
            (axes[0], self.frequency, decibel, frequency, "magnitude error [dB]", self.band),
            (axes[1], self.frequency, degrees, frequency, "phase error [degree]", self.band),
            (axes[2], self.lag, self.lag_error, lag, "relative error of the kernel",
             (self.step, self.horizon)),
        ):  # fmt: skip
            # An exact order is drawn at the bottom, not left out.
            lines = ax.loglog(at, np.maximum(np.abs(error), 1e-16))
            ax.set_xlabel(along)
            ax.set_ylabel(what)
            ax.axvspan(*band, alpha=0.1, color="grey")
            ax.grid(True, which="major", alpha=0.4)
        labels = [f"order {order:g}" for order in self.order]
        figure.legend(lines, labels, loc="outside lower center", ncols=5)
        figure.suptitle(f"{self.design!r}, step {self.step:g} s, horizon {self.horizon:g} s")
        if path is not None:
            path = Path(path)
            kind = path.suffix.removeprefix(".") or "png"
            with replacing(path) as temporary:
                figure.savefig(temporary, format=kind, dpi=150)
        return figure


report = OperatorReport


def _longest(good: BoolArray) -> slice:
    """Return where the longest run of true values is."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], good, [0]]))).reshape(-1, 2)
    longest = edges[np.ptp(edges, axis=1).argmax()] if len(edges) else (0, 0)
    return slice(*longest)


@checked
def state_space(
    design: Design,
    order: float,
    *,
    step: float,
    horizon: float = DEFAULT_HORIZON,
    sampled: bool = False,
) -> scipy.signal.StateSpace:
    """Return one operator as a `scipy.signal.StateSpace`, for Bode plots and margins.

    For python-control: ``control.ss(s.A, s.B, s.C, s.D)``.

    Parameters
    ----------
    design
        How the operator is realised.
    order
        Order alpha in [0, 1); 1 as well where `sampled`.
    step, horizon
        Sampling step and fitted horizon [s].
    sampled
        False: continuous, from f to D^alpha f, ``H(s) = sum g_i s/(s + p_i)``. For an exponential
        sum the kernel's excess within the newest step, where the sum stays finite and t^-alpha does
        not, is added as one fast mode of the same area and the same mean lag. True: what a `Bank`
        does, exactly, at steps of `step`, from (f, f').

    Raises
    ------
    ArgumentError
        Order 1 in continuous time, which is s and not proper.
    """
    alpha = checks.number("order", order, low=0.0, high=1.0)
    modes = modes_of(design, alpha, step=step, horizon=horizon)
    if sampled:
        r = modes.recursion()
        # The states are the last sample's f and f', and the modes.
        a = np.block([[np.zeros((2, 2 + r.decay.size))], [r.drive_before, np.diag(r.decay)]])
        b = np.concatenate([np.eye(2), r.drive_now])
        c = np.concatenate([r.before, r.weights])
        return scipy.signal.StateSpace(a, b, c[None], r.now[None], dt=step)
    if alpha == 1.0:
        raise ArgumentError("order", "a number below 1 (order 1 is s, not proper)", "1")
    poles, weights = modes.poles, modes.weights
    if not isinstance(design, Crone) and alpha > 0.0:
        # Area and first moment of kernel minus sum on the newest step.
        one = integrate_step(poles, step)
        exact = step ** (1.0 - alpha) * scipy.special.rgamma(2.0 - alpha)
        area = exact - (weights * (one["b1"] + one["b0"])).sum()
        moment = exact * step * (1.0 - alpha) / (2.0 - alpha)
        moment -= (weights * one["b0"]).sum() * step
        # A sum of very few modes may have nothing to add to.
        if area > 0.0 and moment > 0.0:
            poles = np.append(poles, area / moment)
            weights = np.append(weights, area**2 / moment)
    # g s/(s + p) = g - g p/(s + p); the mode with p = 0 is a gain alone.
    return scipy.signal.StateSpace(
        np.diag(-poles), np.ones((poles.size, 1)), -(weights * poles)[None], [[weights.sum()]]
    )
