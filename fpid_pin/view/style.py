"""How figures look, and how they become files; matplotlib is imported only when one is made."""

from __future__ import annotations

import functools
import itertools
import re
from collections.abc import Callable
from contextlib import AbstractContextManager
from importlib import resources
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import replacing
from fpid_pin.text import cut, shown, visible
from fpid_pin.view.palette import PALETTE

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")
FORMATS = ("svg", "pdf", "png")
#: Ink of the style sheet; a report lets it follow the page's own.
INK = "#262626"
#: Points drawn of one curve at most: finer than any printer or screen shows.
_MOST = 1200
#: Letters drawn of a name at most: a legend as wide as a page leaves no room for curves.
_LETTERS = 80
# What XML does not hold, not even as a reference.
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@functools.cache
def _sheet() -> dict[str, Any]:
    from cycler import cycler
    from matplotlib import rc_params_from_file

    with resources.as_file(resources.files("fpid_pin.view") / "fpid_pin.mplstyle") as path:
        given = rc_params_from_file(path, use_default_template=False)
    return {**given, "axes.prop_cycle": cycler(color=PALETTE)}


def in_style() -> AbstractContextManager[None]:
    """Return a context in which the package's style holds, whatever the user's own is.

    Matplotlib's defaults stand for what the sheet leaves open.
    """
    from matplotlib import style

    return style.context(_sheet(), after_reset=True)


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a function draw in the package's style."""

    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with in_style():
            return draw(*args, **kwargs)

    return wrapper


def new_figure(
    rows: int, columns: int, width: float, height: float, *, count: int = 0, share_x: bool = True
) -> tuple[Figure, list[Axes]]:
    """Return a figure (in inches) and its first `count` panels, row by row; 0: all of them."""
    figure = _figure_class()(figsize=(width, height), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex="all" if share_x else "none").flat
    count = count or rows * columns
    for spare in axes[count:]:
        spare.set_visible(False)
    return figure, list(axes[:count])


@functools.cache
def _figure_class() -> type[Figure]:
    from matplotlib.figure import Figure

    class NotebookFigure(Figure):
        """A figure without pyplot: nothing global, and still shown by a notebook."""

        def _repr_png_(self) -> bytes:
            return figure_bytes(self, "png")

    return NotebookFigure


def figure_bytes(figure: Figure, kind: str, dpi: float = 150.0) -> bytes:
    """Return a figure as the bytes of an svg, pdf or png: the same ones every time."""
    checks.choice("format", kind, FORMATS)
    # Dates and versions would make the same figure another file.
    empty: dict[str, dict[str, Any]] = {
        "svg": {"Date": None, "Creator": None},
        "pdf": {"CreationDate": None, "Creator": None, "Producer": None},
        "png": {"Software": None},
    }
    buffer = BytesIO()
    with in_style():
        engine = figure.get_layout_engine()
        if engine is not None:
            # Laid out once: matplotlib would do it anew, at twice the cost, for every file.
            engine.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=empty[kind])
    data = buffer.getvalue()
    if kind == "svg":
        # Of figures that are not ours: letters are drawn as paths, and named in comments.
        data = _NOT_XML.sub("\ufffd", data.decode("utf-8")).encode("utf-8")
    return data


def save_figure(figure: Figure, path: str | Path, *, dpi: float = 150.0) -> Path:
    """Write a figure; the suffix (.svg, .pdf, .png) says as what.

    The same figure gives the same bytes on any day; the file appears whole or not at all.

    Parameters
    ----------
    figure
        What to write.
    path
        Where to.
    dpi
        Of a png.

    Raises
    ------
    ArgumentError
        Another suffix.
    FileFormatError
        The file cannot be written.
    """
    path = Path(path)
    kind = path.suffix.removeprefix(".").lower()
    if kind not in FORMATS:
        raise ArgumentError("path", "a name that ends in .svg, .pdf or .png", shown(str(path)))
    data = figure_bytes(figure, kind, checks.number("dpi", dpi, above=0.0))
    with replacing(path) as temporary:
        temporary.write_bytes(data)
    return path


def lettering(text: object) -> str:
    """Return a name as figures show it: what it says, and no formula, command or hint in it.

    Matplotlib sets what is between dollar signs as mathematics, and leaves out of a legend what
    begins with an underscore.
    """
    plain = cut(visible(str(text)), _LETTERS).replace("$", r"\$")
    return f" {plain}" if plain.startswith("_") else plain


def thinned(t: FloatArray, y: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a curve with fewer points that looks the same: each stretch's ends and extremes."""
    rows = len(t)
    if rows <= _MOST:
        return t, y
    cuts = np.linspace(0, rows, _MOST // 4 + 1).astype(int)
    keep = {0, rows - 1}
    for first, stop in itertools.pairwise(cuts):
        piece = y[first:stop]
        keep |= {int(first), int(stop - 1)}
        if np.isfinite(piece).any():
            keep |= {int(first + np.nanargmin(piece)), int(first + np.nanargmax(piece))}
    chosen = np.array(sorted(keep))
    return t[chosen], y[chosen]
