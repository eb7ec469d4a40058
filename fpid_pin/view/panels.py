"""What figures of runs are made of: panels, curves, legends, and what a run has to show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.view.palette import PLAIN, colour
from fpid_pin.view.style import lettering, new_figure, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.0
# Beside a curve in a cycle colour the reference must be told apart in grey, too: dashed.
REFERENCE: dict[str, Any] = {"color": "#262626", "linestyle": (0, (4, 2)), "linewidth": 1.0}
LIMIT: dict[str, Any] = {"color": "#D55E00", "linestyle": ":"}
GAINS = (("kp", "$K_P$"), ("ki", "$K_I$"), ("kd", "$K_D$"))
ORDERS = (("integral_order", r"$\lambda$"), ("derivative_order", r"$\mu$"))
#: Dashes, each leaving more open than the last.
DASHES: tuple[Any, ...] = ("-", (0, (6, 3)), (0, (2, 4)))
# Part of a panel's height within which two curves are taken for one.
_CLOSE = 0.02
# Inches that a legend takes: a caption's handle and gap, a letter of it, and a row.
_CAPTION_BASE, _CAPTION_LETTER, _LEGEND_ROW = 0.45, 0.066, 0.18
# More joints than this share a row of panels rather than take one each.
_TALL = 4


class Joints(NamedTuple):
    """What figures say of a run's joints: names, units of coordinate and effort, effort limits."""

    names: Sequence[str]
    units: Sequence[str]
    efforts: Sequence[str]
    limits: FloatArray

    def coordinate(self, j: int | None = None) -> str:
        """Return the label of an axis of one joint's angles or positions, or of all."""
        unit = self.units[j] if j is not None else ", ".join(dict.fromkeys(self.units))
        return f"{'angle' if unit == 'rad' else 'position'}, {unit}"

    def error(self, j: int | None = None) -> str:
        """Return the label of an axis of errors."""
        return f"$q_d - q$, {self.coordinate(j).partition(', ')[2]}"

    def effort(self, j: int | None = None) -> str:
        """Return the label of an axis of torques, forces or both."""
        unit = self.efforts[j] if j is not None else ", ".join(dict.fromkeys(self.efforts))
        return f"{'force' if unit == 'N' else 'torque'}, {unit}"

    def lettered(self) -> list[str]:
        """Return the names as figures show them."""
        return [lettering(name) for name in self.names]


def joints_of(run: Run) -> Joints:
    """Return the joints of a run; where its arm cannot be rebuilt they have numbers."""
    try:
        arm = run.arm
    except (KeyError, FpidError):
        n = run.q.shape[1]
        names = [f"joint {j + 1}" for j in range(n)]
        return Joints(names, ["rad"] * n, ["N m"] * n, np.full(n, np.inf))
    return Joints(list(arm.joint_names), arm.units, arm.effort_units, arm.effort_limit)


def line(axes: Axes, t: FloatArray, y: FloatArray, label: str = "", **look: Any) -> None:
    """Draw one curve over time, thinned to what can be seen."""
    axes.plot(*thinned(t, y), label=label or "_", **look)


def legend(axes: Axes, columns: int) -> None:
    """Put the legend above the panel, where no data can be."""
    axes.legend(
        loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=columns, borderaxespad=0.1,
        handlelength=1.8, columnspacing=1.2,
    )  # fmt: skip


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


def shared_legend(figure: Figure, captions: Sequence[str]) -> None:
    """Put one legend for all panels below them, in as many columns as its captions leave room for.

    A legend of a panel would be as wide as its captions, whatever is left for the panels.
    """
    captions = [lettering(caption) for caption in captions]
    longest = max(len(caption) for caption in captions)
    width = figure.get_size_inches()[0]
    most = max(int(width / (_CAPTION_BASE + _CAPTION_LETTER * longest)), 1)
    rows = -(-len(captions) // most)
    handles = figure.axes[0].get_lines()[: len(captions)]
    figure.legend(handles, captions, loc="outside lower center", ncols=-(-len(captions) // rows),
                  handlelength=1.8, columnspacing=1.2)  # fmt: skip
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * rows)


def grid(run: Run, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel a joint under its name, in one column or two."""
    names = joints_of(run).lettered()
    columns = 1 if len(names) <= _TALL else 2
    rows = -(-len(names) // columns)
    width = WIDTH if columns == 1 else 1.35 * WIDTH
    figure, panels = new_figure(rows, columns, width, 0.5 + height * rows, count=len(names))
    for panel, name in zip(panels, names, strict=True):
        panel.set_title(name)
    for bottom in panels[-columns:]:
        bottom.set_xlabel("time, s")
        bottom.tick_params(labelbottom=True)
    return figure, panels


def has_all(run: Run, signals: Sequence[tuple[str, str]]) -> bool:
    """Whether a run recorded all of these: `GAINS`, or `ORDERS`, which are those that moved."""
    return all(name in run.signals for name, _ in signals)


def has_supervisor(run: Run) -> bool:
    """Whether a run's controller had a supervisor."""
    given = run.meta["controller"].get("supervisor") is not None
    return given and {"lyapunov", "u_s"} <= set(run.signals)
