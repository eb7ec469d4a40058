"""Figures of a campaign: every plant in one picture, and what its errors hang on."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.statistics import DECIDES, quantile, scored, spearman, tornado
from fpid_pin.checks import FloatArray
from fpid_pin.view import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure

#: Metrics that are drawn, and what their axes say.
SHOWN = {"rms_tail": "RMS error of the last half", "energy": "energy", "peak_torque": "peak torque"}
_WIDE = 9.6  # inches of a page
_FAR = 8.0  # times the median from which on an axis is logarithmic
_BARS = 12  # parameters of a tornado at most: those that matter most
_LETTERS, _LINES = 34, 3  # of a controller's name above its panel
_GREY, _LOST = "#808080", "#D20D48"


def label(data: CampaignData, metric: str = DECIDES) -> str:
    """Return what an axis or a table calls a metric, with its unit."""
    return f"{SHOWN[metric]}, {data.unit(metric)}"


def _scale(panel: Axes, scores: FloatArray) -> bool:
    """Choose a panel's horizontal scale; return whether it is logarithmic.

    So it is where values are positive and so far apart that most would be crowded otherwise.
    """
    from matplotlib.ticker import MaxNLocator

    sound = scores[np.isfinite(scores)]
    if not sound.size:
        panel.text(0.5, 0.5, "all runs were lost", ha="center", transform=panel.transAxes)
    elif sound.min() > 0.0:
        middle = float(np.median(sound))
        if sound.max() > _FAR * middle or middle > _FAR * sound.min():
            panel.set_xscale("log")
            _write_out(panel.xaxis, sound)
            return True
    panel.xaxis.set_major_locator(MaxNLocator(5))
    return False


def _write_out(axis: Axis, values: FloatArray) -> None:
    """Label a logarithmic axis of these values, as densely as there is room for."""
    from matplotlib.ticker import LogLocator, NullFormatter, NullLocator

    decades = np.log10(values.max() / values.min())
    marks = (1.0, 2.0, 5.0) if decades < 1.5 else (1.0, 3.0) if decades < 2.5 else (1.0,)
    axis.set_major_locator(LogLocator(subs=marks))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())
    axis.set_minor_formatter(NullFormatter())


def all_of(data: CampaignData) -> dict[str, Figure]:
    """Return the figures of a campaign by their captions; what would say nothing is left out."""
    caption = "Share of all plants with at most so much; a curve ends where runs were lost"
    figures = {
        caption: distributions(data),
        "Runs that ended well: distribution, quartiles, median": violins(data),
    }
    if (effects(tornado(data)) >= 0.0).any():
        caption = "Median error where a parameter is in its lowest and in its highest fifth"
        figures[caption] = tornado_plot(data)
    pair = two_that_matter(data)
    if pair is not None:
        figures["Every plant; colour: RMS error, cross: lost"] = scatter(data, *pair)
    return figures


@style.styled
def distributions(data: CampaignData) -> Figure:
    """Draw what share of the plants each controller keeps below any error, energy and torque.

    Of all plants: a curve ends at its controller's success rate.
    """
    figure, axes = style.new_figure(1, len(SHOWN), _WIDE, 3.1, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        for k, column in enumerate(scores.T):
            errors = np.sort(column[np.isfinite(column)])
            x = np.append(errors[:1], errors)
            x, y = style.thinned(x, np.linspace(0.0, 100.0 * len(errors) / data.runs, len(x)))
            dashes = style.DASHES[min(k // style.PLAIN, len(style.DASHES) - 1)]
            panel.step(x, y, where="post", color=style.colour(k), linestyle=dashes)
        panel.set(xlabel=label(data, metric), ylim=(-2.0, 102.0))
        _scale(panel, scores)
    axes[0].set_ylabel("share of all plants, %")
    style.shared_legend(figure, data.controllers)
    return figure


@style.styled
def violins(data: CampaignData) -> Figure:
    """Draw the distribution of error, energy and torque of the runs that ended well.

    Inside: the median and the quartiles.
    """
    names = [textwrap.fill(style.lettering(name), 24) for name in data.controllers]
    height = 0.8 + 0.5 * len(names)
    figure, axes = style.new_figure(1, len(SHOWN), _WIDE, height, share_x=False)
    for panel, metric in zip(axes, SHOWN, strict=True):
        scores = scored(data, metric)
        log = _scale(panel, scores)
        for k, column in enumerate(scores.T):
            values = column[np.isfinite(column)]
            if len(values):
                _violin(panel, values, k, log)
        panel.set(xlabel=label(data, metric), ylim=(len(names) - 0.5, -0.5))
        panel.set_yticks(range(len(names)), names if panel is axes[0] else [])
        panel.grid(visible=False, axis="y")
    return figure


def _violin(panel: Axes, values: FloatArray, k: int, log: bool) -> None:
    from scipy.stats import gaussian_kde

    low, first, median, third, high = np.quantile(values, [0.0, 0.25, 0.5, 0.75, 1.0])
    if len(values) > 2 and high - low > 1e-9 * abs(high):
        # What is seen is the density over the axis as it is drawn.
        drawn = np.log(values) if log else values
        grid = np.linspace(drawn.min(), drawn.max(), 160)
        # A few thousand are as smooth as all.
        density = gaussian_kde(drawn[:: max(len(drawn) // 4000, 1)])(grid)
        width = 0.4 * density / density.max()
        panel.fill_between(np.exp(grid) if log else grid, k - width, k + width, alpha=0.45,
                           color=style.colour(k), linewidth=0.0)  # fmt: skip
    panel.plot([first, third], [k, k], color=style.INK, linewidth=3.0, solid_capstyle="butt")
    panel.plot([median], [k], "o", color="#f4f4f4", markeredgecolor=style.INK, markersize=4.5)


@style.styled
def tornado_plot(data: CampaignData) -> Figure:
    """Draw each controller's median error where a parameter is small, and where it is large.

    Parameters come in the order of their largest effect; an arrow stands for a median beyond the
    axis because most of the runs there were lost.
    """
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    ends = tornado(data)
    effect = effects(ends)
    order = np.argsort(-effect, kind="stable")[:_BARS]
    order = order[effect[order] >= 0.0]
    figure, panels, columns = _panels(data, 0.75 + 0.26 * max(len(order), 2), 0.15)
    for k, (panel, middle) in enumerate(zip(panels, quantile(scored(data), 0.5), strict=True)):
        _bars(panel, ends[k, order], float(middle), k)
        left = k % columns == 0
        labels = [style.lettering(data.parameters[j]) if left else "" for j in order]
        panel.set_yticks(range(len(order)), labels)
        panel.set(xlabel=f"median {label(data)}", ylim=(max(len(order), 1) - 0.4, -0.6))
    key = {
        "the parameter's lowest fifth": Patch(facecolor="none", edgecolor=_GREY),
        "its highest fifth": Patch(color=_GREY),
        "all plants": Line2D([], [], color=style.INK, linewidth=1.0),
    }
    style.shared_legend(figure, list(key), list(key.values()))
    return figure


def effects(ends: FloatArray) -> FloatArray:
    """Return how much each parameter changes a median at most, -1 where nobody knows."""
    with np.errstate(invalid="ignore"):  # inf - inf: lost at both ends
        change = np.abs(ends[..., 1] - ends[..., 0])
    return np.asarray(np.where(np.isnan(change), -1.0, change).max(axis=0, initial=-1.0))


def _bars(panel: Axes, ends: FloatArray, middle: float, k: int) -> None:
    from matplotlib.ticker import MaxNLocator

    known = np.append(ends, middle)
    known = known[np.isfinite(known)]
    panel.grid(visible=False, axis="y")
    if not known.size:
        panel.text(0.5, 0.5, "too few runs ended", ha="center", transform=panel.transAxes)
        return
    room = 0.06 * (np.ptp(known) or abs(known[0]) or 1.0)
    beyond = known.max() + 2.0 * room
    base = middle if np.isfinite(middle) else beyond
    for end, values in enumerate(ends.T):
        # The two ends lie beside each other: both may be on one side of the middle.
        rows, lost = np.arange(len(values)) + 0.19 * (2 * end - 1), np.isinf(values)
        length = np.nan_to_num(np.where(lost, beyond, values) - base)
        panel.barh(rows, length, 0.36, base, edgecolor=style.colour(k),
                   facecolor=style.colour(k) if end else "none")  # fmt: skip
        for row in rows[lost]:
            panel.plot([beyond], [row], ">", color=style.colour(k), markersize=6, clip_on=False)
    if np.isfinite(middle):
        panel.axvline(middle, color=style.INK, linewidth=1.0)
    panel.xaxis.set_major_locator(MaxNLocator(4))
    panel.set_xlim(known.min() - room, beyond if np.isinf(ends).any() else known.max() + room)


def two_that_matter(data: CampaignData) -> tuple[int, int] | None:
    """Return the two parameters, by column, that go with the errors most; None: not two."""
    rho = np.abs(spearman(data)[..., 0])
    strength = np.where(np.isnan(rho), -1e-9, rho).sum(axis=0)
    order = np.argsort(-strength, kind="stable")[:2]
    if len(order) < 2 or strength[order[1]] < 0.0:
        return None
    return int(order.min()), int(order.max())


@style.styled
def scatter(data: CampaignData, x: int, y: int) -> Figure:
    """Draw every plant by two of its parameters, by column; colour: its error, cross: lost."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    scores = scored(data)
    figure, panels, columns = _panels(data, 2.9, 0.5)
    sound = scores[np.isfinite(scores) & (scores > 0.0)]
    # All panels have one scale; a hundredth at either end does not stretch it.
    low, high = np.quantile(sound, [0.01, 0.99]) if sound.size else (1.0, 2.0)
    norm = LogNorm(low, max(high, 1.01 * low))
    size = float(np.clip(8000.0 / max(data.runs, 1), 2.0, 25.0))
    units = [data.units[j] and f", {data.units[j]}" for j in (x, y)]
    heads = [style.lettering(data.parameters[j] + u) for j, u in zip((x, y), units, strict=True)]
    for k, (panel, error) in enumerate(zip(panels, scores.T, strict=True)):
        order = np.argsort(error, kind="stable")  # the worst on top
        kept, lost = order[np.isfinite(error[order])], order[~np.isfinite(error[order])]
        a, b = data.samples[:, x], data.samples[:, y]
        # As a picture within the figure: ten thousand marks are no smaller a file otherwise.
        panel.scatter(a[kept], b[kept], size, error[kept], norm=norm, linewidths=0.0,
                      rasterized=True)  # fmt: skip
        panel.scatter(a[lost], b[lost], 2.0 * size + 4.0, _LOST, marker="x", linewidths=0.8,
                      rasterized=True)  # fmt: skip
        panel.set(xlabel=heads[0], ylabel="" if k % columns else heads[1])
        panel.tick_params(labelbottom=True)
    bar = figure.colorbar(ScalarMappable(norm), ax=panels, label=label(data), extend="both",
                          fraction=0.04)  # fmt: skip
    _write_out(bar.ax.yaxis, np.array([norm.vmin, norm.vmax]))
    return figure


def _panels(data: CampaignData, row: float, below: float) -> tuple[Figure, list[Axes], int]:
    """Return a figure, its panels and columns; `row`, `below`: inches of a row, and below."""
    count = len(data.controllers)
    # No more than three side by side, and none left by itself.
    columns = 2 if count in (2, 4) else min(count, 3)
    rows = -(-count // columns)
    size = _WIDE, row * rows + below
    figure, panels = style.new_figure(rows, columns, *size, count=count, share_x=False)
    for k, (panel, name) in enumerate(zip(panels, data.controllers, strict=True)):
        # Long names would push their neighbour's panel aside.
        lines = textwrap.wrap(style.lettering(name), _LETTERS)[:_LINES]
        panel.set_title("\n".join(lines), color=style.colour(k))
    return figure, panels, columns
