"""Figures of searches and rankings: costs over orders, parameters, generations, conditions."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.view.style import INK, PALETTE, colour, lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MARKS = "o*DsP^v"
# A ranking: times the best of a condition at which a cell has the last colour; the colour of the
# best, which no other cell has; letters of a name in a row of its heading; inches of a cell, of a
# letter and of a line.
_FAR, _BEST = 30.0, "#bfe6d3"
_COLUMN, _ROW = 14, 34
_WIDE, _HIGH, _LETTER, _LINE = 0.78, 0.3, 0.075, 0.155


@styled
def cost_map(
    orders_lambda: FloatArray,
    orders_mu: FloatArray,
    costs: FloatArray,
    marks: Mapping[str, Sequence[float]],
) -> Figure:
    """Draw the cost (L, M) over the plane of the orders, (L,) and (M,); marks are (lambda, mu).

    The scale is logarithmic where every cost is positive; inf, where a run diverged, is hatched.
    """
    from matplotlib.colors import LogNorm, Normalize

    figure, (panel,) = new_figure(1, 1, 5.2, 4.2 + 0.25 * ((len(marks) + 1) // 2))
    sound = np.isfinite(costs)
    found = costs[sound] if sound.any() else np.ones(1)
    low, high = float(found.min()), float(found.max())
    norm = (LogNorm if low > 0.0 else Normalize)(low, max(high, 1.01 * low, 1e-300))
    # A patch behind shows through where there is no cost.
    panel.patch.set(hatch="///", edgecolor="#b0b0b0", facecolor="white")
    masked = np.ma.masked_where(~sound, costs)
    mesh = panel.pcolormesh(
        orders_lambda, orders_mu, masked.T, norm=norm, shading="nearest", cmap="cividis"
    )
    figure.colorbar(mesh, ax=panel, label="cost")
    for k, (label, point) in enumerate(marks.items()):
        panel.plot(
            *point, _MARKS[k % len(_MARKS)], color=PALETTE[1], markeredgecolor="white",
            markersize=9, label=lettering(label), linestyle="none",
        )  # fmt: skip
    # Below the map: beside or above it, long names would squeeze it.
    figure.legend(loc="outside lower center", ncols=2)
    panel.grid(False)
    panel.set(xlabel=r"integral order $\lambda$", ylabel=r"derivative order $\mu$")
    title = "" if sound.all() else "hatched: diverged"
    panel.set_title(title, loc="right", fontweight="normal", fontsize=8)
    return figure


@styled
def convergence(curves: Mapping[str, FloatArray]) -> Figure:
    """Draw costs over generations, (G,) by name; what is not finite leaves a gap."""
    from matplotlib.ticker import MaxNLocator

    figure, (panel,) = new_figure(1, 1, 5.6, 3.2)
    for (name, costs), dash in zip(curves.items(), ("-", "--", ":", "-.") * 8, strict=False):
        panel.plot(
            np.arange(1, costs.size + 1), np.where(np.isfinite(costs), costs, np.nan), dash,
            label=lettering(name), marker="." if costs.size < 30 else "",
        )  # fmt: skip
    positive = all((costs > 0.0).all() for costs in curves.values())
    panel.set(xlabel="generation", ylabel="cost", yscale="log" if positive else "linear")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(curves))
    return figure


@styled
def profile(labels: Sequence[str], values: FloatArray, costs: FloatArray, best: float) -> Figure:
    """Draw the cost along each parameter in turn, all others held.

    `values` and `costs` are (parameters, K), +inf where a run diverges; `best` is the cost of the
    controller itself, the dotted line.
    """
    columns = min(len(labels), 4)
    rows = -(-len(labels) // columns)
    size = 1.9 * columns + 0.8, 1.6 * rows + 0.5
    figure, panels = new_figure(rows, columns, *size, count=len(labels), share_x=False)
    finite = costs[np.isfinite(costs)]
    top = max(float(finite.max(initial=best)), 1.1 * best)
    # Costs may be 0.
    top = min(top, 10.0 * best or top) or 1.0
    for k, (panel, label, x, y) in enumerate(zip(panels, labels, values, costs, strict=True)):
        panel.plot(x, np.where(y <= top, y, np.nan), ".-")
        panel.axhline(best, color=PALETTE[1], linestyle=":")
        panel.set(
            ylim=(0.0, 1.05 * top), title=lettering(label), ylabel="" if k % columns else "cost"
        )
        panel.tick_params(labelleft=k % columns == 0)
    return figure


@styled
def heat_map(
    values: FloatArray, controllers: Sequence[str], conditions: Sequence[str], label: str
) -> Figure:
    """Draw figures of merit, (conditions, controllers), under a label with their unit.

    Each condition is a column with colours of its own: the best is green, the others are the darker
    the farther behind it; inf is a run that ended early.
    """
    from matplotlib.colors import LogNorm
    from matplotlib.patches import Rectangle

    heads = [textwrap.fill(lettering(name), _COLUMN) for name in conditions]
    sides = [textwrap.fill(lettering(name), _ROW) for name in controllers]
    table = np.asarray(values, dtype=np.float64).T
    best = table.min(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        behind = np.nan_to_num(table / best, nan=_FAR, posinf=_FAR).clip(1.0, _FAR)
    rows, columns = table.shape
    beside = _LETTER * max(len(line) for side in sides for line in side.split("\n")) + 0.4
    above = _LINE * (max(head.count("\n") for head in heads) + 2.5)
    width = max(beside + _WIDE * columns, 3.6)
    figure, (axes,) = new_figure(1, 1, width, above + _HIGH * rows + 0.8)
    image = axes.imshow(behind, cmap="YlOrBr", norm=LogNorm(1.0, _FAR), aspect="auto", alpha=0.85)
    for (row, column), value in np.ndenumerate(table):
        first = np.isfinite(value) and value == best[column]
        if first:
            axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, facecolor=_BEST))
        axes.text(
            column, row, f"{value:.3g}" if np.isfinite(value) else "ended", ha="center",
            va="center", fontsize=8, fontweight="bold" if first else "normal",
            color="#f4f4f4" if behind[row, column] > 0.4 * _FAR else INK,
        )  # fmt: skip
    axes.set_xticks(range(columns), heads)
    axes.set_yticks(range(rows), sides)
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
    for k, tick in enumerate(axes.get_yticklabels()):
        tick.set(color=colour(k), fontweight="bold")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    ticks = (1, 3, 10, 30)
    bar = figure.colorbar(image, ax=axes, orientation="horizontal", ticks=ticks, aspect=30)
    bar.ax.set_xticks(ticks, ["best", *(f"{tick}x" for tick in ticks[1:])])
    bar.ax.minorticks_off()
    figure.supxlabel("times the best of the same column, which is green", fontsize=8)
    figure.suptitle(lettering(label), fontsize=9)
    return figure
