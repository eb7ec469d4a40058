"""Figures of searches and rankings: costs over orders, parameters, generations, conditions."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
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
    orders_lambda: ArrayLike,
    orders_mu: ArrayLike,
    costs: ArrayLike,
    marks: Mapping[str, Sequence[float]] | None = None,
) -> Figure:
    """Draw the cost over the plane of the orders, on a logarithmic scale.

    Parameters
    ----------
    orders_lambda, orders_mu
        Integral orders (L,) and derivative orders (M,), increasing.
    costs
        (L, M), positive; inf or NaN where a run diverged, drawn hatched.
    marks
        Points to point out, ``{"label": (lambda, mu)}``.

    Raises
    ------
    ArgumentError
        Shapes that do not fit, or no finite cost at all.
    """
    from matplotlib.colors import LogNorm

    x = checks.floats("orders_lambda", orders_lambda, max_ndim=1)
    y = checks.floats("orders_mu", orders_mu, max_ndim=1)
    z = np.asarray(costs, dtype=np.float64)
    if z.shape != (x.size, y.size):
        raise ArgumentError("costs", f"shape ({x.size}, {y.size})", f"shape {z.shape}")
    sound = np.isfinite(z) & (z > 0.0)
    if not sound.any():
        raise ArgumentError("costs", "at least one finite positive cost", "none")
    rows = (len(marks or {}) + 1) // 2
    figure, (panel,) = new_figure(1, 1, 5.2, 4.2 + 0.25 * rows)
    low, high = float(z[sound].min()), float(z[sound].max())
    norm = LogNorm(low, max(high, low * 1.01))
    # A patch behind shows through where there is no cost.
    panel.patch.set(hatch="///", edgecolor="#b0b0b0", facecolor="white")
    masked = np.ma.masked_where(~sound, z)
    mesh = panel.pcolormesh(x, y, masked.T, norm=norm, shading="nearest", cmap="cividis")
    figure.colorbar(mesh, ax=panel, label="cost")
    for k, (label, point) in enumerate((marks or {}).items()):
        panel.plot(
            float(point[0]), float(point[1]), _MARKS[k % len(_MARKS)], color=PALETTE[1],
            markeredgecolor="white", markersize=9, label=lettering(label), linestyle="none",
        )  # fmt: skip
    if marks:
        # Below the map: beside or above it, long names would squeeze it.
        figure.legend(loc="outside lower center", ncols=2)
    panel.grid(False)
    panel.set(xlabel=r"integral order $\lambda$", ylabel=r"derivative order $\mu$")
    title = "" if sound.all() else "hatched: diverged"
    panel.set_title(title, loc="right", fontweight="normal", fontsize=8)
    return figure


@styled
def convergence(history: ArrayLike | Mapping[str, ArrayLike]) -> Figure:
    """Draw cost over generations.

    Parameters
    ----------
    history
        The best cost of each generation, (G,), or several such curves by name
        (``{"best": ..., "median": ...}``). What is not finite leaves a gap.

    Raises
    ------
    ArgumentError
        No curve, or one without a finite cost.
    """
    from matplotlib.ticker import MaxNLocator

    curves = history if isinstance(history, Mapping) else {"best": history}
    if not curves:
        raise ArgumentError("history", "at least one curve", "none")
    figure, (panel,) = new_figure(1, 1, 5.6, 3.2)
    positive = True
    for (name, values), dash in zip(curves.items(), ("-", "--", ":", "-.") * 8, strict=False):
        costs = np.atleast_1d(np.asarray(values, dtype=np.float64))
        sound = np.isfinite(costs)
        if costs.ndim != 1 or not sound.any():
            raise ArgumentError(f"history.{name}", "a row of costs, some finite", f"{costs!r}")
        positive &= bool((costs[sound] > 0.0).all())
        panel.plot(
            np.arange(1, costs.size + 1), np.where(sound, costs, np.nan), dash,
            label=lettering(name), marker="." if costs.size < 30 else "",
        )  # fmt: skip
    panel.set(xlabel="generation", ylabel="cost", yscale="log" if positive else "linear")
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    if len(curves) > 1:
        panel.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=len(curves))
    return figure


@styled
def profile(labels: Sequence[str], values: FloatArray, costs: FloatArray, best: float) -> Figure:
    """Draw the cost along each parameter in turn, all others held.

    Parameters
    ----------
    labels
        Of the parameters.
    values, costs
        (parameters, K); +inf where a run diverges.
    best
        The cost of the controller itself: the dotted line.
    """
    columns = min(len(labels), 4)
    rows = -(-len(labels) // columns)
    size = 1.9 * columns + 0.8, 1.6 * rows + 0.5
    figure, panels = new_figure(rows, columns, *size, count=len(labels), share_x=False)
    finite = costs[np.isfinite(costs)]
    top = min(max(float(finite.max(initial=best)), 1.1 * best), 10.0 * best)
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
    """Draw figures of merit; each condition is a column with colours of its own.

    The best of a column is green, the others are the darker the farther behind it.

    Parameters
    ----------
    values
        (conditions, controllers), the less the better; inf where a run ended early.
    controllers, conditions
        Names.
    label
        What is shown, with its unit.
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
