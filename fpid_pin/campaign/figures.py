"""Figures of a campaign: every plant in one picture; matplotlib is imported when one is made."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.campaign.data import METRICS, CampaignData
from fpid_pin.campaign.statistics import ecdf, quantile, scored, spearman, tornado
from fpid_pin.checks import FloatArray
from fpid_pin.view.palette import PLAIN, colour
from fpid_pin.view.panels import DASHES
from fpid_pin.view.style import lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Metrics that are drawn, and what their axes say.
SHOWN = {"rms": "RMS error", "energy": "energy", "peak_torque": "peak torque"}
#: Parameters of a tornado at most: those that matter most.
_BARS = 12
_LOST = "#D20D48"
_WIDE = 9.6


def label(metric: str) -> str:
    """Return what an axis or a table calls a metric, with its unit."""
    unit = METRICS[metric].replace("^2", "²")
    return f"{SHOWN.get(metric, metric)}, {unit}"


def _names(data: CampaignData) -> list[str]:
    return [lettering(name) for name in data.controllers]


def _columns(count: int) -> int:
    """Return how many panels stand side by side: no more than three, and none left by itself."""
    return 2 if count in (2, 4) else min(count, 3)


def _numbered(data: CampaignData, k: int) -> str:
    """Return a parameter's label with its unit."""
    unit = data.units[k]
    return lettering(f"{data.parameters[k]}, {unit}" if unit else data.parameters[k])


def _logarithmic(values: FloatArray) -> bool:
    """Whether values are positive and so far apart that a linear axis would crowd most of them."""
    sound = values[np.isfinite(values)]
    if sound.size == 0 or sound.min() <= 0.0:
        return False
    return bool(sound.max() > 8.0 * np.median(sound) or np.median(sound) > 8.0 * sound.min())


def _legend(figure: Figure, data: CampaignData) -> None:
    from matplotlib.lines import Line2D

    names, handles = _names(data), []
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
    figure, (axes,) = new_figure(1, len(SHOWN), _WIDE, 3.3, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        for k, column in enumerate(scores.T):
            values, shares = ecdf(column)
            # A curve of every plant would be as long as the campaign.
            keep = np.unique(np.linspace(0, len(values) - 1, min(len(values), 400)).astype(int))
            panel.step(values[keep], 100.0 * shares[keep], where="post", color=colour(k),
                       linestyle=_dash(k))  # fmt: skip
        panel.set(xlabel=label(metric), ylim=(-2.0, 102.0))
        if _logarithmic(scores):
            panel.set_xscale("log")
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
    names = [textwrap.fill(name, 24) for name in _names(data)]
    height = 0.8 + 0.5 * len(names)
    figure, (axes,) = new_figure(1, len(SHOWN), _WIDE, height, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        log = _logarithmic(scores)
        for k, column in enumerate(scores.T):
            values = column[np.isfinite(column)]
            if len(values):
                _violin(panel, values, k, log)
        if log:
            panel.set_xscale("log")
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


@styled
def tornado_plot(data: CampaignData) -> Figure:
    """Draw each controller's median error where a parameter is small, and where it is large.

    Parameters come in the order of their largest effect; an arrow stands for a median beyond the
    axis because most of the runs there were lost.
    """
    ends = tornado(data)
    middle = np.array([quantile(column, 0.5) for column in scored(data).T])
    effect = _effects(ends)
    order = np.argsort(-effect, kind="stable")[:_BARS]
    order = order[effect[order] >= 0.0]
    names, count = _names(data), len(data.controllers)
    columns = _columns(count)
    rows = -(-count // columns)
    height = rows * (0.75 + 0.26 * max(len(order), 2)) + 0.35
    figure, axes = new_figure(rows, columns, _WIDE, height, share_x=False)
    flat = [panel for row in axes for panel in row]
    for spare in flat[count:]:
        spare.set_visible(False)
    for k, (panel, name) in enumerate(zip(flat, names, strict=False)):
        _bars(panel, ends[k, order], float(middle[k]), k)
        # Long names would push their neighbour's panel aside.
        panel.set_title("\n".join(textwrap.wrap(name, 34)[:3]), color=colour(k))
        left = k % columns == 0
        labels = [lettering(data.parameters[j]) if left else "" for j in order]
        panel.set_yticks(range(len(order)), labels)
        panel.set_ylim(max(len(order), 1) - 0.4, -0.6)
        panel.set_xlabel(f"median {label('rms')}")
    figure.legend(*_tornado_key(), loc="outside lower center", ncols=3)
    return figure


def _effects(ends: FloatArray) -> FloatArray:
    """Return how much each parameter changes a median at most, -1 where nobody knows."""
    with np.errstate(invalid="ignore"):  # inf - inf: lost at both ends
        change = np.abs(ends[..., 1] - ends[..., 0])
    return np.asarray(np.where(np.isnan(change), -1.0, change).max(axis=0, initial=-1.0))


def _tornado_key() -> tuple[list[Artist], list[str]]:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    grey = "#808080"
    low = Patch(facecolor="none", edgecolor=grey)
    line = Line2D([], [], color="#262626", linewidth=1.0)
    return [low, Patch(color=grey), line], [
        "the parameter's lowest fifth", "its highest fifth", "all plants",
    ]  # fmt: skip


def _bars(panel: Axes, ends: FloatArray, middle: float, k: int) -> None:
    from matplotlib.ticker import MaxNLocator

    sound = ends[np.isfinite(ends)]
    known = np.append(sound, middle) if np.isfinite(middle) else sound
    panel.grid(visible=False, axis="y")
    if not known.size:
        panel.text(0.5, 0.5, "too few runs ended", ha="center", transform=panel.transAxes)
        return
    room = 0.06 * (np.ptp(known) or abs(known[0]) or 1.0)
    beyond = known.max() + 2.0 * room
    base = middle if np.isfinite(middle) else beyond
    for row, pair in enumerate(ends):
        for end, value in enumerate(pair):
            if np.isnan(value):
                continue
            shown = value if np.isfinite(value) else beyond
            # The two ends lie beside each other: both may be on one side of the middle.
            panel.barh(row + 0.19 * (2 * end - 1), shown - base, 0.36, base, edgecolor=colour(k),
                       facecolor=colour(k) if end else "none")  # fmt: skip
            if np.isinf(value):
                panel.plot([beyond], [row + 0.19 * (2 * end - 1)], ">", color=colour(k),
                           markersize=6, clip_on=False)  # fmt: skip
    if np.isfinite(middle):
        panel.axvline(middle, color="#262626", linewidth=1.0)
    panel.xaxis.set_major_locator(MaxNLocator(4))
    panel.set_xlim(known.min() - room, beyond if np.isinf(ends).any() else known.max() + room)


def two_that_matter(data: CampaignData) -> tuple[int, int] | None:
    """Return the two parameters that go with the errors most; None where there are not two.

    In the order of their columns.
    """
    rho = np.abs(spearman(data)[..., 0])
    strength = np.where(np.isnan(rho), -1e-9, rho).sum(axis=0)
    order = np.argsort(-strength, kind="stable")[:2]
    if len(order) < 2 or strength[order[1]] < 0.0:
        return None
    first, second = sorted(int(j) for j in order)
    return first, second


@styled
def scatter(data: CampaignData, x: int, y: int) -> Figure:
    """Draw every plant by two of its parameters, by column; colour: its error, cross: lost."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    scores, count = scored(data), len(data.controllers)
    columns = _columns(count)
    rows = -(-count // columns)
    figure, axes = new_figure(rows, columns, _WIDE, 0.5 + 2.9 * rows)
    flat = [panel for row in axes for panel in row]
    for spare in flat[count:]:
        spare.set_visible(False)
    sound = scores[np.isfinite(scores) & (scores > 0.0)]
    # All panels have one scale; a hundredth at either end does not stretch it.
    low, high = np.quantile(sound, [0.01, 0.99]) if sound.size else (1.0, 2.0)
    norm = LogNorm(low, max(high, 1.01 * low))
    size = float(np.clip(8000.0 / max(data.runs, 1), 2.0, 25.0))
    for k, (panel, name) in enumerate(zip(flat, _names(data), strict=False)):
        error = scores[:, k]
        kept, lost = np.flatnonzero(np.isfinite(error)), np.flatnonzero(~np.isfinite(error))
        kept = kept[np.argsort(error[kept], kind="stable")]  # the worst on top
        a, b = data.samples[:, x], data.samples[:, y]
        # As a picture within the figure: ten thousand marks are no smaller a file otherwise.
        panel.scatter(a[kept], b[kept], size, error[kept], norm=norm, linewidths=0.0,
                      rasterized=True)  # fmt: skip
        panel.scatter(a[lost], b[lost], 2.0 * size + 4.0, _LOST, marker="x", linewidths=0.8,
                      rasterized=True)  # fmt: skip
        panel.set_title("\n".join(textwrap.wrap(name, 34)[:3]), color=colour(k))
        panel.set_xlabel(_numbered(data, x))
        panel.tick_params(labelbottom=True)
        if k % columns == 0:
            panel.set_ylabel(_numbered(data, y))
    figure.colorbar(
        ScalarMappable(norm), ax=flat[:count], label=label("rms"), extend="both", fraction=0.04
    )
    return figure
