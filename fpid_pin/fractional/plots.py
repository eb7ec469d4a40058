"""Figures of a design's errors. Matplotlib is imported here, and only when one is drawn."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.fractional.report import Report


def plot_report(report: Report, path: str | Path | None = None) -> Any:
    """Draw magnitude and phase errors against frequency, and the kernel's error against lag.

    Parameters
    ----------
    report
        Of `Design.report`.
    path
        File to write, by its suffix; None writes none.

    Returns
    -------
    matplotlib.figure.Figure
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 9.0), layout="constrained")
    magnitude, phase, lags = figure.subplots(3, 1)
    omega = report.frequency
    ratio = report.response / (1j * omega[:, None]) ** report.order
    tiny = 1e-16  # an exact order is drawn at the bottom, not left out
    for k, order in enumerate(report.order):
        label = f"order {order:g}"
        decibel = np.abs(20.0 * np.log10(np.maximum(np.abs(ratio[:, k]), 1e-300)))
        magnitude.loglog(omega, np.maximum(decibel, tiny), label=label)
        degrees = np.abs(np.degrees(np.angle(ratio[:, k])))
        phase.loglog(omega, np.maximum(degrees, tiny), label=label)
        lags.loglog(report.lag, np.maximum(np.abs(report.lag_error[:, k]), tiny), label=label)
    for axes, what in ((magnitude, "magnitude error [dB]"), (phase, "phase error [degree]")):
        axes.set_xlabel("angular frequency [rad/s]")
        axes.set_ylabel(what)
        axes.axvspan(*report.band, alpha=0.1, color="grey")
    lags.set_xlabel("lag [s]")
    lags.set_ylabel("relative error of the kernel")
    lags.axvspan(report.step, report.horizon, alpha=0.1, color="grey")
    for axes in (magnitude, phase, lags):
        axes.grid(True, which="major", alpha=0.4)
    figure.legend(*lags.get_legend_handles_labels(), loc="outside lower center", ncols=5)
    figure.suptitle(f"{report.design}, step {report.step:g} s, horizon {report.horizon:g} s")
    if path is not None:
        figure.savefig(path, dpi=150)
    return figure
