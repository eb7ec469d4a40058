"""What a campaign's errors hang on: tornado plots, and plants by two of their parameters."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.figures import WIDE, label, names_of, write_out
from fpid_pin.campaign.statistics import quantile, scored, spearman, tornado
from fpid_pin.checks import FloatArray
from fpid_pin.view.palette import colour
from fpid_pin.view.style import lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Parameters of a tornado at most: those that matter most.
_BARS = 12
_LOST = "#D20D48"
# Letters of a controller's name in a line above its panel, and lines.
_LETTERS, _LINES = 34, 3


@styled
def tornado_plot(data: CampaignData) -> Figure:
    """Draw each controller's median error where a parameter is small, and where it is large.

    Parameters come in the order of their largest effect; an arrow stands for a median beyond the
    axis because most of the runs there were lost.
    """
    ends = tornado(data)
    middle = np.array([quantile(column, 0.5) for column in scored(data).T])
    effect = effects(ends)
    order = np.argsort(-effect, kind="stable")[:_BARS]
    order = order[effect[order] >= 0.0]
    figure, panels, columns = _panels(data, 0.75 + 0.26 * max(len(order), 2), 0.35)
    for k, panel in enumerate(panels):
        _bars(panel, ends[k, order], float(middle[k]), k)
        left = k % columns == 0
        labels = [lettering(data.parameters[j]) if left else "" for j in order]
        panel.set_yticks(range(len(order)), labels)
        panel.set_ylim(max(len(order), 1) - 0.4, -0.6)
        panel.set_xlabel(f"median {label('rms')}")
    figure.legend(*_tornado_key(), loc="outside lower center", ncols=3)
    return figure


def effects(ends: FloatArray) -> FloatArray:
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

    scores = scored(data)
    figure, panels, columns = _panels(data, 2.9, 0.5)
    sound = scores[np.isfinite(scores) & (scores > 0.0)]
    # All panels have one scale; a hundredth at either end does not stretch it.
    low, high = np.quantile(sound, [0.01, 0.99]) if sound.size else (1.0, 2.0)
    norm = LogNorm(low, max(high, 1.01 * low))
    size = float(np.clip(8000.0 / max(data.runs, 1), 2.0, 25.0))
    for k, panel in enumerate(panels):
        error = scores[:, k]
        kept, lost = np.flatnonzero(np.isfinite(error)), np.flatnonzero(~np.isfinite(error))
        kept = kept[np.argsort(error[kept], kind="stable")]  # the worst on top
        a, b = data.samples[:, x], data.samples[:, y]
        # As a picture within the figure: ten thousand marks are no smaller a file otherwise.
        panel.scatter(a[kept], b[kept], size, error[kept], norm=norm, linewidths=0.0,
                      rasterized=True)  # fmt: skip
        panel.scatter(a[lost], b[lost], 2.0 * size + 4.0, _LOST, marker="x", linewidths=0.8,
                      rasterized=True)  # fmt: skip
        panel.set_xlabel(_numbered(data, x))
        panel.tick_params(labelbottom=True)
        if k % columns == 0:
            panel.set_ylabel(_numbered(data, y))
    bar = figure.colorbar(ScalarMappable(norm), ax=panels, label=label("rms"), extend="both",
                          fraction=0.04)  # fmt: skip
    write_out(bar.ax.yaxis, np.array([norm.vmin, norm.vmax]))
    return figure


def _numbered(data: CampaignData, k: int) -> str:
    """Return a parameter's label with its unit."""
    unit = data.units[k]
    return lettering(f"{data.parameters[k]}, {unit}" if unit else data.parameters[k])


def _panels(data: CampaignData, row: float, below: float) -> tuple[Figure, list[Axes], int]:
    """Return a figure, its panels and columns; `row`, `below`: inches of a row, and below."""
    count = len(data.controllers)
    # No more than three side by side, and none left by itself.
    columns = 2 if count in (2, 4) else min(count, 3)
    rows = -(-count // columns)
    size = WIDE, row * rows + below
    figure, panels = new_figure(rows, columns, *size, count=count, share_x=False)
    for k, (panel, name) in enumerate(zip(panels, names_of(data), strict=True)):
        # Long names would push their neighbour's panel aside.
        panel.set_title("\n".join(textwrap.wrap(name, _LETTERS)[:_LINES]), color=colour(k))
    return figure, panels, columns
