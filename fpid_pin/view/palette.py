"""One colour a controller: in figures, tables, replays and playgrounds."""

from __future__ import annotations

#: Okabe and Ito's without the green of a replay's ghost, brown and ink; from the eighth on, those
#: farthest in CIE Lab from all before.
PALETTE = (
    "#0072B2", "#D55E00", "#CC79A7", "#E69F00", "#56B4E9", "#8A6D3B", "#262626", "#5C1E83",
    "#0DCC0D", "#0D0DE6", "#D20D48", "#97BB48", "#6F1E34", "#E60DD2", "#20520D", "#0D52E6",
    "#AAA9AA", "#E63097", "#009E73", "#D275E6",
)  # fmt: skip
#: The first of them on a dark page.
ON_DARK = (
    "#5db4f0", "#ff9350", "#ee9fcb", "#f2c14b", "#9bd8ff", "#d3b684", "#c9ced6", "#c0a5f0",
)  # fmt: skip
#: Of these nobody mistakes one for another; those after them are also drawn with dashes.
PLAIN = 8


def colour(k: int) -> str:
    """Return the colour of the k-th of several."""
    return PALETTE[k % len(PALETTE)]
