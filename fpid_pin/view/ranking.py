"""Controllers against conditions in one picture: who is best where, and by how much."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.view.palette import colour
from fpid_pin.view.style import lettering, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Times the best of a condition at which a cell has the last colour.
_FAR = 30.0
#: Of the best of a condition, which no other cell has.
_BEST = "#bfe6d3"
# Letters of a name in a row of its heading; inches of a cell, of a letter and of a line.
_COLUMN, _ROW = 14, 34
_WIDE, _HIGH, _LETTER, _LINE = 0.78, 0.3, 0.075, 0.155


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
        ended = not np.isfinite(value)
        first = not ended and value == best[column]
        if first:
            axes.add_patch(Rectangle((column - 0.5, row - 0.5), 1.0, 1.0, facecolor=_BEST))
        axes.text(
            column, row, "ended" if ended else f"{value:.3g}", ha="center", va="center", fontsize=8,
            fontweight="bold" if first else "normal",
            color="#f4f4f4" if behind[row, column] > 0.4 * _FAR else "#262626",
        )  # fmt: skip
    axes.set_xticks(range(columns), heads)
    axes.set_yticks(range(rows), sides)
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
    for k, tick in enumerate(axes.get_yticklabels()):
        tick.set_color(colour(k))
        tick.set_fontweight("bold")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    ticks = (1, 3, 10, 30)
    bar = figure.colorbar(image, ax=axes, orientation="horizontal", ticks=ticks, aspect=30)
    bar.ax.set_xticks(ticks, ["best", *(f"{tick}x" for tick in ticks[1:])])
    bar.ax.minorticks_off()
    figure.supxlabel("times the best of the same column, which is green", fontsize=8)
    figure.suptitle(lettering(label), fontsize=9)
    return figure
