"""Figures of a campaign: every plant in one picture; matplotlib is imported when one is made."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.campaign.data import METRICS, CampaignData
from fpid_pin.campaign.statistics import ecdf, scored
from fpid_pin.checks import FloatArray
from fpid_pin.view.palette import PLAIN, colour
from fpid_pin.view.panels import DASHES
from fpid_pin.view.style import lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

#: Metrics that are drawn, and what their axes say.
SHOWN = {"rms": "RMS error", "energy": "energy", "peak_torque": "peak torque"}
#: Inches of a page.
WIDE = 9.6
# Times the median from which on an axis is logarithmic.
_FAR = 8.0


def label(metric: str) -> str:
    """Return what an axis or a table calls a metric, with its unit."""
    unit = METRICS[metric].replace("^2", "²")
    return f"{SHOWN.get(metric, metric)}, {unit}"


def names_of(data: CampaignData) -> list[str]:
    """Return the controllers' names as figures show them."""
    return [lettering(name) for name in data.controllers]


def _scale(panel: Axes, scores: FloatArray) -> bool:
    """Choose a panel's horizontal scale; return whether it is logarithmic.

    So it is where values are positive and so far apart that most would be crowded otherwise.
    """
    from matplotlib.ticker import MaxNLocator

    sound = scores[np.isfinite(scores)]
    if sound.size and sound.min() > 0.0:
        middle = float(np.median(sound))
        if sound.max() > _FAR * middle or middle > _FAR * sound.min():
            panel.set_xscale("log")
            write_out(panel.xaxis, scores)
            return True
    panel.xaxis.set_major_locator(MaxNLocator(5))
    return False


def write_out(axis: Axis, values: FloatArray) -> None:
    """Label a logarithmic axis of these values, as densely as there is room for."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter, NullLocator

    sound = values[np.isfinite(values)]
    decades = np.log10(sound.max() / sound.min())
    marks = (1.0, 2.0, 5.0) if decades < 1.5 else (1.0, 3.0) if decades < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=marks))
    axis.set_major_formatter(FuncFormatter(lambda x, _: f"{x:g}"))
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def _legend(figure: Figure, data: CampaignData) -> None:
    from matplotlib.lines import Line2D

    names, handles = names_of(data), []
    for k in range(len(names)):
        handles.append(Line2D([], [], color=colour(k), linestyle=_dash(k), linewidth=2.0))
    columns = max(int(figure.get_figwidth() / (0.5 + 0.07 * max(map(len, names)))), 1)
    figure.legend(handles, names, loc="outside lower center", ncols=min(columns, len(names)))


def _dash(k: int) -> object:
    return DASHES[min(k // PLAIN, len(DASHES) - 1)]


@styled
def distributions(data: CampaignData) -> Figure:
    """Draw what share of the plants each controller keeps below any error, energy and torque.

    Of all plants: a curve ends at its controller's success rate.
    """
    figure, axes = new_figure(1, len(SHOWN), WIDE, 3.3, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        for k, column in enumerate(scores.T):
            values, shares = ecdf(column)
            # A curve of every plant would be as long as the campaign.
            keep = np.unique(np.linspace(0, len(values) - 1, min(len(values), 400)).astype(int))
            x, y = np.append(values[:1], values[keep]), np.append(0.0, 100.0 * shares[keep])
            panel.step(x, y[: len(x)], where="post", color=colour(k), linestyle=_dash(k))
        panel.set(xlabel=label(metric), ylim=(-2.0, 102.0))
        _scale(panel, scores)
        _say_if_empty(panel, scores)
    axes[0].set_ylabel("share of all plants, %")
    _legend(figure, data)
    return figure


def _say_if_empty(panel: Axes, scores: FloatArray) -> None:
    if not np.isfinite(scores).any():
        panel.text(0.5, 0.5, "all runs were lost", ha="center", va="center",
                   transform=panel.transAxes)  # fmt: skip


@styled
def violins(data: CampaignData) -> Figure:
    """Draw the distribution of error, energy and torque of the runs that ended well.

    Inside: the median and the quartiles.
    """
    names = [textwrap.fill(name, 24) for name in names_of(data)]
    height = 0.8 + 0.5 * len(names)
    figure, axes = new_figure(1, len(SHOWN), WIDE, height, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        log = _scale(panel, scores)
        for k, column in enumerate(scores.T):
            values = column[np.isfinite(column)]
            if len(values):
                _violin(panel, values, k, log)
        panel.set(xlabel=label(metric), ylim=(len(names) - 0.5, -0.5))
        panel.set_yticks(range(len(names)), names if panel is axes[0] else [])
        panel.grid(visible=False, axis="y")
        _say_if_empty(panel, scores)
    return figure


def _violin(panel: Axes, values: FloatArray, k: int, log: bool) -> None:
    from scipy.stats import gaussian_kde

    low, first, median, third, high = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0])
    if high > low and len(values) > 2 and high - low > 1e-9 * abs(high):
        # What is seen is the density over the axis as it is drawn.
        drawn = np.log(values) if log else values
        grid = np.linspace(drawn.min(), drawn.max(), 160)
        # A few thousand are as smooth as all.
        density = gaussian_kde(drawn[:: max(len(drawn) // 4000, 1)])(grid)
        width = 0.4 * density / density.max()
        panel.fill_between(np.exp(grid) if log else grid, k - width, k + width, color=colour(k),
                           alpha=0.45, linewidth=0.0)  # fmt: skip
    panel.plot([first, third], [k, k], color="#262626", linewidth=3.0, solid_capstyle="butt")
    panel.plot([median], [k], "o", color="#f4f4f4", markeredgecolor="#262626", markersize=4.5)
