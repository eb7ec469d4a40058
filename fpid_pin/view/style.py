"""How figures look, what they are put together from, and how they become files.

Matplotlib is imported only when one is made.
"""

from __future__ import annotations

import functools
import re
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, ParamSpec

import numpy as np

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, checked
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import replacing
from fpid_pin.simulation.run import Run
from fpid_pin.text import cut, shown, visible

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

P = ParamSpec("P")
#: One colour a controller, in figures, tables, replays and playgrounds: Okabe and Ito's without the
#: green of a replay's ghost, brown and ink; from the eighth on those farthest in CIE Lab from all
#: before.
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
#: Dashes, each leaving more open than the last.
DASHES: tuple[Any, ...] = ("-", (0, (6, 3)), (0, (2, 4)))
#: Ink of the style sheet; a report lets it follow the page's own.
INK = "#262626"
#: What a file is not to say, for a figure to be the same file on any day.
_METADATA = {
    "svg": ("Date", "Creator"), "pdf": ("CreationDate", "Creator", "Producer"),
    "png": ("Software",),
}  # fmt: skip
#: Points drawn of one curve at most: finer than any printer or screen shows.
_MOST = 1200
# Inches that a legend takes: a caption's handle and gap, a letter of it, and a row.
_CAPTION_BASE, _CAPTION_LETTER, _LEGEND_ROW = 0.45, 0.066, 0.18
#: Letters drawn of a name at most: a legend as wide as a page leaves no room for curves.
_LETTERS = 80
# What XML does not hold, not even as a reference.
_NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
# Beside a curve in a cycle colour the reference must be told apart in grey, too: dashed.
REFERENCE: dict[str, Any] = {"color": INK, "linestyle": (0, (4, 2)), "linewidth": 1.0}
# Part of a panel's height within which two curves are taken for one.
_CLOSE = 0.02


def colour(k: int) -> str:
    """Return the colour of the k-th of several."""
    return PALETTE[k % len(PALETTE)]


def in_style() -> AbstractContextManager[None]:
    """Return a context in which the package's style holds, whatever the user's own is.

    Matplotlib's defaults stand for what the sheet leaves open.
    """
    from cycler import cycler
    from matplotlib import style

    sheets = ["fpid_pin.view.fpid_pin", {"axes.prop_cycle": cycler(color=PALETTE)}]
    return style.context(sheets, after_reset=True)


def styled(draw: Callable[P, Figure]) -> Callable[P, Figure]:
    """Make a function draw in the package's style."""

    @checked
    @functools.wraps(draw)
    def wrapper(*args: P.args, **kwargs: P.kwargs) -> Figure:
        with in_style():
            return draw(*args, **kwargs)

    return wrapper


def new_figure(
    rows: int,
    columns: int,
    width: float,
    height: float,
    *,
    count: int = 0,
    share_x: bool = True,
    share_y: bool | Literal["row"] = False,
) -> tuple[Figure, list[Axes]]:
    """Return a figure (in inches) and its first `count` panels, row by row; 0: all of them."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    # Without pyplot nothing is global; a notebook shows it all the same.
    vars(figure)["_repr_png_"] = functools.partial(figure_bytes, figure, "png")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=share_x, sharey=share_y).flat
    count = count or rows * columns
    for spare in axes[count:]:
        spare.set_visible(False)
    return figure, list(axes[:count])


def figure_bytes(figure: Figure, kind: str, dpi: float = 150.0) -> bytes:
    """Return a figure as the bytes of an svg, pdf or png: the same ones every time."""
    checks.choice("format", kind, _METADATA)
    buffer = BytesIO()
    with in_style():
        engine = figure.get_layout_engine()
        if engine is not None:
            # Laid out once: matplotlib would do it anew, at twice the cost, for every file.
            engine.execute(figure)
            figure.set_layout_engine("none")
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=dict.fromkeys(_METADATA[kind]))
    data = buffer.getvalue()
    if kind == "svg":
        # Of figures that are not ours: letters are drawn as paths, and named in comments.
        data = _NOT_XML.sub("\ufffd", data.decode("utf-8")).encode("utf-8")
    return data


@checked
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
    if kind not in _METADATA:
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
    if len(t) <= _MOST:
        return t, y
    pieces = np.array_split(np.arange(len(t)), _MOST // 4)
    chosen = np.unique([(k[0], k[y[k].argmin()], k[y[k].argmax()], k[-1]) for k in pieces])
    return t[chosen], y[chosen]


def line(axes: Axes, t: FloatArray, y: FloatArray, label: str = "", **look: Any) -> None:
    """Draw one curve over time, thinned to what can be seen."""
    axes.plot(*thinned(t, y), label=label or "_", **look)


def legend(axes: Axes, columns: int) -> None:
    """Put the legend above the panel, where no data can be."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1,
        handlelength=1.8, columnspacing=1.2,
    )  # fmt: skip


def shared_legend(figure: Figure, captions: Sequence[str], handles: Sequence[Any] = ()) -> None:
    """Put one legend for all panels below them, in as many columns as its captions leave room for.

    `handles` are the curves that captions are of; none: the first of the first panel.

    A legend of a panel would be as wide as its captions, whatever is left for the panels.
    """
    captions = [lettering(caption) for caption in captions]
    longest = max(len(caption) for caption in captions)
    width = figure.get_size_inches()[0]
    most = max(int(width / (_CAPTION_BASE + _CAPTION_LETTER * longest)), 1)
    rows = -(-len(captions) // most)
    handles = handles or figure.axes[0].get_lines()[: len(captions)]
    figure.legend(handles, captions, loc="outside lower center", ncols=-(-len(captions) // rows),
                  handlelength=1.8, columnspacing=1.2)  # fmt: skip
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * rows)


# ------------------------------------------------------------------ panels of runs


def as_runs(runs: Run | Sequence[Run]) -> list[Run]:
    """Return a list whether one run or several are given."""
    return list(runs) if isinstance(runs, Sequence) else [runs]


def captions_of(runs: Sequence[Run], captions: Sequence[str] | None) -> list[str]:
    """Return one caption a run: those given, else the runs' names, told apart by number."""
    if captions is not None:
        texts = [captions] if isinstance(captions, str) else [str(text) for text in captions]
        if len(texts) != len(runs):
            raise ArgumentError("captions", f"{len(runs)} (one a run)", f"{len(texts)}")
        return [short(text) for text in texts]
    names = [short(run.name) for run in runs]
    return [
        name if names.count(name) == 1 else f"{name} ({names[:k].count(name) + 1})"
        for k, name in enumerate(names)
    ]


def short(text: str) -> str:
    """Return a name or caption as pictures have room for it."""
    return cut(visible(text), _LETTERS)


def axis_label(arm: Arm, quantity: str, j: int | None = None) -> str:
    """Return the label of an axis of one joint's ``q``, ``error`` or ``torque``, or of all."""
    units = arm.effort_units if quantity == "torque" else arm.units
    unit = ", ".join(dict.fromkeys(units)) if j is None else units[j]
    names = {"q": "angle" if unit == "rad" else "position", "error": "$q_d - q$",
             "torque": "force" if unit == "N" else "torque"}  # fmt: skip
    return f"{names[quantity]}, {unit}"


def lettered(arm: Arm) -> list[str]:
    """Return the joints' names as figures show them."""
    return [lettering(name) for name in arm.joint_names]


def looks_of(runs: Sequence[Run]) -> list[dict[str, Any]]:
    """Return how each of several runs is drawn, in the palette's order.

    One that follows an earlier one closely is dashed, so that both are seen; so are those whose
    colours alone might be mistaken.
    """
    looks = []
    for k, run in enumerate(runs):
        dash = max(k // PLAIN, sum(_hides(run, earlier) for earlier in runs[:k]))
        looks.append({"color": colour(k), "linestyle": DASHES[min(dash, len(DASHES) - 1)]})
    return looks


def _hides(run: Run, earlier: Run) -> bool:
    """Return whether the errors of a run would cover those of another for most of the time."""
    rows = min(len(run.t), len(earlier.t))
    if not rows:
        return False
    apart = np.median(np.abs(run.error[:rows] - earlier.error[:rows]), axis=0)
    return bool((apart <= _CLOSE * np.ptp(earlier.error[:rows], axis=0)).all())


def overview(run: Run, panels: Sequence[Axes]) -> None:
    """Draw all joints into three panels: angles and references, torques, errors in some order."""
    arm, names = run.arm, lettered(run.arm)
    for panel, quantity in zip(panels, ("q", "error", "torque"), strict=True):
        for j, name in enumerate(names):
            look: dict[str, Any] = {"color": colour(j)}
            line(panel, run.t, getattr(run, quantity)[:, j], name, **look)
            limit = arm.effort_limit[j]
            if quantity == "q":
                last = j == len(names) - 1
                line(panel, run.t, run.q_ref[:, j], "desired" if last else "", **REFERENCE)
            elif quantity == "torque" and np.abs(run.torque[:, j]).max(initial=0.0) > 0.5 * limit:
                for height in (limit, -limit):
                    panel.axhline(height, linewidth=1.0, linestyle=":", **look)
        panel.set_ylabel(axis_label(arm, quantity))
    legend(panels[0], min(len(names) + 1, 4))
