"""A design's errors, gains and cost in one table and one figure."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.files import replacing
from fpid_pin.fractional.design import Design
from fpid_pin.fractional.modes import ComplexArray
from fpid_pin.shown import Shown

#: The table's columns: attribute, title, what its numbers are, width.
_COLUMNS = (
    ("order", "order", "", 8),
    ("magnitude_error", "magnitude", "dB", 10),
    ("phase_error", "phase", "deg", 10),
    ("kernel_error", "kernel", "relative", 10),
    ("error_bound", "bound", "of |f'|", 10),
    ("lowest_frequency", "trusted", "from rad/s", 11),
    ("highest_frequency", "trusted", "to rad/s", 10),
    ("longest_horizon", "trusted", "to s", 10),
    ("nyquist_gain", "Nyquist", "gain", 9),
    ("noise_from_value", "noise", "from f", 9),
    ("noise_from_rate", "noise", "from f'", 9),
)


@dataclass(frozen=True, eq=False, repr=False)
class OperatorReport(Shown):
    """How far a design can be trusted, for each of its orders; prints as a table.

    All arrays are (orders,) unless another shape is given.

    Attributes
    ----------
    design, step, horizon
        What was measured; step and horizon [s].
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
        lines = [
            f"{self.design}, step {self.step:g} s, horizon {self.horizon:g} s,"
            f" {self.states} numbers a signal",
            f"cost of a sample: {one * 1e6:.1f} us for one signal,"
            f" {many / 240 * 1e9:.0f} ns a signal for 240",
            f"magnitude and phase over {self.band[0]:.3g} .. {self.band[1]:.3g} rad/s;"
            " trusted: within 1 %; noise: output for one unit a sample",
            "".join(f"{title:>{width}}" for _, title, _, width in _COLUMNS),
            "".join(f"{unit:>{width}}" for _, _, unit, width in _COLUMNS),
        ]
        for row in range(self.order.size):
            cells = [
                f"{getattr(self, name)[row]:>{width}.{4 if name == 'order' else 2}g}"
                for name, _, _, width in _COLUMNS
            ]
            lines.append("".join(cells))
        return "\n".join(lines)

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
        ratio = self.response / (1j * self.frequency[:, None]) ** self.order
        decibel = 20.0 * np.log10(np.maximum(np.abs(ratio), 1e-300))
        degrees = np.degrees(np.angle(ratio))
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
        figure.suptitle(f"{self.design}, step {self.step:g} s, horizon {self.horizon:g} s")
        if path is not None:
            path = Path(path)
            kind = path.suffix.removeprefix(".") or "png"
            with replacing(path) as temporary:
                figure.savefig(temporary, format=kind, dpi=150)
        return figure
