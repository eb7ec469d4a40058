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

#: Times the best of a condition from which on a cell has the last colour.
_FAR = 30.0
# Not white: that is what a report takes out as paper.
_PALE = "#f4f4f4"
# Letters of a name in a row of its heading; inches of a cell, of a letter and of a line.
_COLUMN, _ROW = 14, 34
_WIDE, _HIGH, _LETTER, _LINE = 0.78, 0.3, 0.075, 0.155


@styled
def heat_map(
    values: FloatArray, controllers: Sequence[str], conditions: Sequence[str], label: str
) -> Figure:
    """Draw figures of merit, the best of each condition framed.

    Parameters
    ----------
    values
        (conditions, controllers), the less the better; inf where a run ended early.
    controllers, conditions
        Names.
    label
        What is shown, with its unit.
    """
    from matplotlib.patches import Rectangle

    heads = [textwrap.fill(lettering(name), _COLUMN) for name in conditions]
    sides = [textwrap.fill(lettering(name), _ROW) for name in controllers]
    table = np.asarray(values, dtype=np.float64).T
    best = table.min(axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        behind = np.log10(table / best)
    behind[~np.isfinite(behind)] = np.inf
    rows, columns = table.shape
    beside = _LETTER * max(len(line) for side in sides for line in side.split("\n")) + 0.4
    above = _LINE * (max(head.count("\n") for head in heads) + 2.5)
    width = max(beside + _WIDE * columns, 3.6)
    figure, ((axes,),) = new_figure(1, 1, width, above + _HIGH * rows + 0.25)
    shades = np.clip(behind, 0.0, np.log10(_FAR))
    axes.imshow(shades, cmap="cividis_r", vmin=0.0, vmax=np.log10(_FAR), aspect="auto")
    for (row, column), value in np.ndenumerate(table):
        ended = not np.isfinite(value)
        axes.text(
            column, row, "ended" if ended else f"{value:.3g}", ha="center", va="center", fontsize=8,
            color=_PALE if shades[row, column] > 0.55 * np.log10(_FAR) else "#262626",
        )  # fmt: skip
        if not ended and value == best[column]:
            axes.add_patch(Rectangle((column - 0.48, row - 0.46), 0.96, 0.92, fill=False,
                                     edgecolor="#D55E00", linewidth=2.0))  # fmt: skip
    axes.set_xticks(range(columns), heads)
    axes.set_yticks(range(rows), sides)
    axes.tick_params(top=True, labeltop=True, bottom=False, labelbottom=False, length=0)
    for k, tick in enumerate(axes.get_yticklabels()):
        tick.set_color(colour(k))
        tick.set_fontweight("bold")
    axes.grid(visible=False)
    axes.spines[:].set_visible(False)
    figure.suptitle(
        f"{lettering(label)}; framed: least; darker: more, to {_FAR:g} times", fontsize=9
    )
    return figure
