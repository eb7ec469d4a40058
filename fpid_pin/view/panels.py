"""What figures of runs are made of: panels, curves, legends, and what a run has to show."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.view.palette import PLAIN, colour
from fpid_pin.view.style import lettering, new_figure, thinned

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH = 7.0
# Beside a curve in a cycle colour the reference must be told apart in grey, too: dashed.
REFERENCE: dict[str, Any] = {"color": "#262626", "linestyle": (0, (4, 2)), "linewidth": 1.0}
GAINS = (("kp", "$K_P$"), ("ki", "$K_I$"), ("kd", "$K_D$"))
ORDERS = (("integral_order", r"$\lambda$"), ("derivative_order", r"$\mu$"))
# Of the gains over rad, and over rad and the scale's kg m^2.
GAIN_UNITS = {
    "none": ("N m/rad", r"N m/(rad s$^\lambda$)", r"N m s$^\mu$/rad"),
    "scaled": ("s$^{-2}$", r"s$^{-2-\lambda}$", r"s$^{\mu-2}$"),
}
#: Dashes, each leaving more open than the last.
DASHES: tuple[Any, ...] = ("-", (0, (6, 3)), (0, (2, 4)))
# Part of a panel's height within which two curves are taken for one.
_CLOSE = 0.02
# Inches that a legend takes: a caption's handle and gap, a letter of it, and a row.
_CAPTION_BASE, _CAPTION_LETTER, _LEGEND_ROW = 0.45, 0.066, 0.18
# More joints than this share a row of panels rather than take one each.
_TALL = 4


def names_of(run: Run) -> list[str]:
    """Return the joints' names, or numbers where the arm cannot be rebuilt."""
    try:
        return list(run.arm.joint_names)
    except (KeyError, FpidError):
        return [f"joint {j + 1}" for j in range(run.q.shape[1])]


def joint_units(run: Run) -> list[tuple[str, str]]:
    """Return the units of each joint's coordinate and effort; see `Arm.units`."""
    try:
        return list(zip(run.arm.units, run.arm.effort_units, strict=True))
    except (KeyError, FpidError):
        return [("rad", "N m")] * run.q.shape[1]


def shared_units(run: Run) -> tuple[str, str]:
    """Return the units of a panel that all joints share: ``rad``, ``m`` or ``rad, m``."""
    coordinates, efforts = zip(*joint_units(run), strict=True)
    return ", ".join(dict.fromkeys(coordinates)), ", ".join(dict.fromkeys(efforts))


def lettered_names(run: Run) -> list[str]:
    """Return the joints' names as figures show them."""
    return [lettering(name) for name in names_of(run)]


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
        look = {"color": colour(k), "linestyle": DASHES[min(dash, len(DASHES) - 1)]}
        looks.append(look)
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
    columns = -(-len(captions) // rows)
    handles = figure.axes[0].get_lines()[: len(captions)]
    figure.legend(handles, captions, loc="outside lower center", ncols=columns,
                  handlelength=1.8, columnspacing=1.2)  # fmt: skip
    figure.set_figheight(figure.get_figheight() + _LEGEND_ROW * rows)


def grid(run: Run, height: float) -> tuple[Figure, list[Axes]]:
    """Return a figure with one panel a joint, in one column or two."""
    n = run.q.shape[1]
    columns = 1 if n <= _TALL else 2
    rows = -(-n // columns)
    width = WIDTH if columns == 1 else 1.35 * WIDTH
    figure, axes = new_figure(rows, columns, width, 0.5 + height * rows)
    flat = [a for row in axes for a in row]
    for spare in flat[n:]:
        spare.set_visible(False)
    for bottom in flat[n - columns : n]:
        bottom.set_xlabel("time, s")
        bottom.tick_params(labelbottom=True)
    return figure, flat[:n]


def draw_tracking(panel: Axes, run: Run, joint: int) -> None:
    """Draw one joint's angle over its reference."""
    line(panel, run.t, run.q[:, joint], "actual")
    line(panel, run.t, run.q_ref[:, joint], "desired", **REFERENCE)


def limits_of(run: Run) -> FloatArray:
    """Return the effort limits of the nominal arm, inf where they are not known."""
    try:
        return run.arm.effort_limit
    except (KeyError, FpidError):
        return np.full(run.q.shape[1], np.inf)


def draw_torque(panel: Axes, run: Run, joint: int, limit: float) -> None:
    """Draw one joint's torque; its limits are drawn where they are near."""
    values = run.torque[:, joint]
    line(panel, run.t, values, "applied")
    peak = float(np.nanmax(np.abs(values), initial=0.0))
    if np.isfinite(limit) and peak > 0.25 * limit:
        for k, sign in enumerate((1.0, -1.0)):
            panel.axhline(sign * limit, label="_" if k else "limit", color="#D55E00", linestyle=":")
    elif np.isfinite(limit):
        text = f"limit $\\pm${limit:g} {joint_units(run)[joint][1]}"
        panel.annotate(
            text, (1.0, 1.02), xycoords="axes fraction", ha="right", va="bottom", fontsize=8
        )


def has_gains(run: Run) -> bool:
    """Whether a run recorded kp, ki and kd."""
    return all(name in run.signals for name, _ in GAINS)


def has_orders(run: Run) -> bool:
    """Whether a run recorded orders: they moved."""
    return all(name in run.signals for name, _ in ORDERS)


def has_supervisor(run: Run) -> bool:
    """Whether a run's controller had a supervisor."""
    given = run.meta["controller"].get("supervisor") is not None
    return given and {"lyapunov", "u_s"} <= set(run.signals)


def threshold_of(run: Run) -> float | None:
    """Return V_M of the run's supervisor, eq. (16); None where it cannot be rebuilt."""
    try:
        supervisor = getattr(run.controller, "supervisor", None)
        value = getattr(supervisor, "threshold", None)
        return float(value(run.q.shape[1]) if callable(value) else value)  # type: ignore[arg-type]
    except (TypeError, ValueError, KeyError):
        return None


def require_same_joints(runs: Sequence[Run]) -> None:
    """Refuse runs that cannot share panels: none, or of different numbers of joints."""
    if not runs:
        raise ArgumentError("runs", "at least one run", "none")
    counts = [run.q.shape[1] for run in runs]
    if len(set(counts)) > 1:
        raise ArgumentError("runs", "one number of joints", ", ".join(map(str, counts)))
