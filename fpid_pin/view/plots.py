"""Figures of runs; each function returns a matplotlib `Figure` without touching pyplot."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.control.suggested import SuggestedFpid
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.view.palette import colour
from fpid_pin.view.panels import (
    GAINS,
    LIMIT,
    ORDERS,
    REFERENCE,
    WIDTH,
    grid,
    has_all,
    has_supervisor,
    joints_of,
    legend,
    line,
    looks_of,
    shared_legend,
)
from fpid_pin.view.ranking import heat_map
from fpid_pin.view.scene import as_runs, captions_of
from fpid_pin.view.searches import convergence, cost_map, profile
from fpid_pin.view.style import figure_bytes, lettering, new_figure, save_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = [
    "comparison",
    "convergence",
    "cost_map",
    "error",
    "figure_bytes",
    "figures",
    "gains",
    "heat_map",
    "lyapunov",
    "phase_plane",
    "plot",
    "profile",
    "response",
    "save_figure",
    "torque",
    "tracking",
]
# Of the gains over rad, and over rad and the scale's kg m^2.
_GAIN_UNITS = ("N m/rad", r"N m/(rad s$^\lambda$)", r"N m s$^\mu$/rad")
_SCALED_UNITS = ("s$^{-2}$", r"s$^{-2-\lambda}$", r"s$^{\mu-2}$")


@styled
def tracking(run: Run) -> Figure:
    """Draw each joint's angle and its reference over time."""
    figure, panels = grid(run, 1.6)
    for j, panel in enumerate(panels):
        line(panel, run.t, run.q[:, j], "actual")
        line(panel, run.t, run.q_ref[:, j], "desired", **REFERENCE)
        panel.set_ylabel(joints_of(run).coordinate(j))
    legend(panels[0], 2)
    return figure


@styled
def error(runs: Run | Sequence[Run]) -> Figure:
    """Draw each joint's tracking error, of one run or several."""
    several = _of_one_size(runs)
    figure, panels = grid(several[0], 1.5)
    for j, panel in enumerate(panels):
        for run, look in zip(several, looks_of(several), strict=True):
            line(panel, run.t, run.error[:, j], **look)
        panel.set_ylabel(joints_of(several[0]).error(j))
    if len(several) > 1:
        shared_legend(figure, captions_of(several, None))
    return figure


@styled
def torque(run: Run) -> Figure:
    """Draw each joint's torque, with its limit where there is one: a line where it is near."""
    figure, panels = grid(run, 1.5)
    joints = joints_of(run)
    for j, (panel, limit) in enumerate(zip(panels, joints.limits, strict=True)):
        line(panel, run.t, run.torque[:, j], "applied")
        panel.set_ylabel(joints.effort(j))
        if np.abs(run.torque[:, j]).max(initial=0.0) > 0.25 * limit:
            panel.axhline(limit, label="limit", **LIMIT)
            panel.axhline(-limit, **LIMIT)
        elif np.isfinite(limit):
            panel.set_title(f"limit $\\pm${limit:g} {joints.efforts[j]}", loc="right",
                            fontsize=8, fontweight="normal")  # fmt: skip
    if np.isfinite(joints.limits).any():
        legend(panels[int(np.argmax(np.isfinite(joints.limits)))], 2)
    return figure


@styled
def gains(run: Run) -> Figure:
    """Draw the adapted gains K_P, K_I, K_D of every joint over time, and orders where they move.

    Raises
    ------
    ArgumentError
        The run's controller has no such gains.
    """
    if not has_all(run, GAINS):
        raise ArgumentError(
            "run", "a run that recorded kp, ki, kd", f"one with {sorted(run.signals)}"
        )
    law = run.meta["controller"]
    suggested = law.get("kind") == SuggestedFpid._kind  # type: ignore[attr-defined]
    scaled = suggested or law.get("scale", "none") != "none"
    units = _SCALED_UNITS if scaled else _GAIN_UNITS
    orders = ORDERS if has_all(run, ORDERS) else ()
    count = 3 + len(orders)
    figure, panels = new_figure(count, 1, WIDTH, 5.0 * count / 3)
    for panel, (name, label), unit in zip(
        panels, (*GAINS, *orders), (*units, "", ""), strict=False
    ):
        for j, joint in enumerate(joints_of(run).lettered()):
            line(panel, run.t, run.signals[name][:, j], joint)
        panel.set_ylabel(f"{label}, {unit}".removesuffix(", "))
        if not unit:
            panel.set_ylim(-0.03, 1.03)
    panels[0].set_title(lettering(run.name))
    legend(panels[0], min(run.q.shape[1], 4))
    panels[-1].set_xlabel("time, s")
    return figure


@styled
def phase_plane(run: Run) -> Figure:
    """Draw each joint's error rate over its error, from start (ring) to end (dot)."""
    joints, n = joints_of(run), run.q.shape[1]
    columns = min(n, 3)
    rows = -(-n // columns)
    size = 2.4 * columns + 0.4, 2.3 * rows
    figure, panels = new_figure(rows, columns, *size, count=n, share_x=False)
    e, rate, stride = run.error, run.v_ref - run.v, max(len(run.t) // 6000, 1)
    for j, (panel, name, unit) in enumerate(
        zip(panels, joints.lettered(), joints.units, strict=True)
    ):
        panel.plot(e[::stride, j], rate[::stride, j], linewidth=0.9)
        panel.plot(e[0, j], rate[0, j], "o", color="#262626", fillstyle="none", markersize=5)
        panel.plot(e[-1, j], rate[-1, j], "o", color="#D55E00", markersize=4)
        panel.set(title=name, xlabel=f"error $e$, {unit}", ylabel=f"$\\dot e$, {unit}/s")
    return figure


@styled
def lyapunov(run: Run) -> Figure:
    """Draw the supervisor's V over time with its threshold V_M, eq. (16), and the torque it gave.

    Raises
    ------
    ArgumentError
        The run's controller had no supervisor.
    """
    if not has_supervisor(run):
        raise ArgumentError("run", "a run with a supervisor", "one without")
    figure, (upper, lower) = new_figure(2, 1, WIDTH, 3.8)
    line(upper, run.t, run.signals["lyapunov"], "$V$")
    with contextlib.suppress(KeyError, FpidError):  # a law that cannot be made again
        supervisor = run.controller.supervisor
        if supervisor is not None:
            upper.axhline(supervisor.threshold, label="$V_M$", **LIMIT)
    upper.set(ylabel="$V$", title=f"{lettering(run.name)}: Lyapunov function")
    legend(upper, 2)
    for j, name in enumerate(joints_of(run).lettered()):
        line(lower, run.t, run.signals["u_s"][:, j], name)
    part = 100.0 * float((run.signals["u_s"] != 0.0).any(axis=1).mean())
    lower.set(
        ylabel="$u_s$, N m", xlabel="time, s", title=f"supervisor, acting {part:.3g} % of the time"
    )
    legend(lower, min(run.q.shape[1], 4))
    return figure


@styled
def comparison(runs: Sequence[Run]) -> Figure:
    """Draw several runs over each other: error and torque of every joint."""
    several = _of_one_size(runs)
    joints, looks = joints_of(several[0]), looks_of(several)
    n = len(joints.names)
    figure, panels = new_figure(n, 2, 1.35 * WIDTH, 0.6 + 1.5 * n)
    for j, name in enumerate(joints.lettered()):
        left, right = panels[2 * j : 2 * j + 2]
        for run, look in zip(several, looks, strict=True):
            line(left, run.t, run.error[:, j], **look)
            line(right, run.t, run.torque[:, j], **look)
        left.set(title=name, ylabel=joints.error(j))
        right.set(ylabel=joints.effort(j))
    for panel in panels[-2:]:
        panel.set_xlabel("time, s")
    shared_legend(figure, captions_of(several, None))
    return figure


def _of_one_size(runs: Run | Sequence[Run]) -> list[Run]:
    several = as_runs(runs)
    if not several:
        raise ArgumentError("runs", "at least one run", "none")
    counts = list(dict.fromkeys(run.q.shape[1] for run in several))
    if len(counts) > 1:
        raise ArgumentError("runs", "one number of joints", ", ".join(map(str, counts)))
    return several


def _overview(run: Run, angle: Axes, e: Axes, u: Axes) -> None:
    """Draw all joints into three panels: angles and references, errors, torques."""
    joints = joints_of(run)
    names = joints.lettered()
    for j, name in enumerate(names):
        look: dict[str, Any] = {"color": colour(j)}
        line(angle, run.t, run.q[:, j], name, **look)
        line(e, run.t, run.error[:, j], name, **look)
        line(u, run.t, run.torque[:, j], name, **look)
        last = j == len(names) - 1
        line(angle, run.t, run.q_ref[:, j], "desired" if last else "", **REFERENCE)
        if np.abs(run.torque[:, j]).max(initial=0.0) > 0.5 * joints.limits[j]:
            for limit in (joints.limits[j], -joints.limits[j]):
                u.axhline(limit, linewidth=1.0, linestyle=":", **look)
    angle.set_ylabel(joints.coordinate())
    e.set_ylabel(joints.error())
    u.set_ylabel(joints.effort())
    legend(angle, min(len(names) + 1, 4))


@styled
def plot(run: Run) -> Figure:
    """Draw a run at a glance: angles and references, errors, torques, gains where it has any.

    Orders that move have a panel, too.
    """
    kinds = [
        (title, kind)
        for title, kind in (("gains", GAINS), ("orders", ORDERS))
        if has_all(run, kind)
    ]
    rows = 3 + len(kinds)
    figure, (angle, e, u, *more) = new_figure(rows, 1, WIDTH, 1.7 * rows + 0.3)
    _overview(run, angle, e, u)
    figure.suptitle(f"{lettering(run.name)}: {lettering(run.outcome)}", fontsize=10)
    for panel, (title, kind) in zip(more, kinds, strict=True):
        for (name, label), dash in zip(kind, ("-", "--", ":"), strict=False):
            for j in range(run.q.shape[1]):
                look = {"color": colour(j), "linestyle": dash}
                line(panel, run.t, run.signals[name][:, j], "" if j else label, **look)
        panel.set_ylabel(title)
        legend(panel, 3)
    (more or [u])[-1].set_xlabel("time, s")
    return figure


@styled
def response(run: Run, heading: str = "") -> Figure:
    """Draw the panels of Figs. 4 and 5: (a) tracking, (b) control signals, (c) errors.

    Parameters
    ----------
    run
        What to draw; all joints share each panel.
    heading
        Above the figure; the run's name if empty.
    """
    figure, (track, control, e) = new_figure(3, 1, 6.6, 6.6)
    _overview(run, track, e, control)
    track.set_title("(a) tracking")
    control.set_title("(b) control signals")
    e.set(title="(c) tracking errors", xlabel="time, s")
    figure.suptitle(lettering(heading or run.name), fontsize=10)
    return figure


def is_integer(run: Run) -> bool:
    """Whether a run's controller is of integer orders (or has no orders at all)."""
    table = run.meta["controller"]
    orders = [table.get(f"{kind}_order", 1.0) for kind in ("integral", "derivative")]
    return all(bool((np.asarray(order, dtype=np.float64) == 1.0).all()) for order in orders)


def figures(runs: Run | Sequence[Run]) -> dict[str, Figure]:
    """Return the figures of an experiment by name.

    ``fig4`` is the first integer-order run and ``fig5`` the first fractional one, as in the paper;
    ``gains`` those of the fractional run (else of the first that has any), ``lyapunov`` its
    supervisor, ``comparison`` all runs. What the runs do not hold is left out.
    """
    several = as_runs(runs)
    integer = [run for run in several if is_integer(run)]
    fractional = [run for run in several if not is_integer(run)]
    drawn: dict[str, Figure] = {}
    if integer:
        drawn["fig4"] = response(integer[0], f"Integer orders: {integer[0].name}")
    if fractional:
        drawn["fig5"] = response(fractional[0], f"Fractional orders: {fractional[0].name}")
    first = [*fractional, *integer]
    with_gains = [run for run in first if has_all(run, GAINS)]
    supervised = [run for run in first if has_supervisor(run)]
    if with_gains:
        drawn["gains"] = gains(with_gains[0])
    if supervised:
        drawn["lyapunov"] = lyapunov(supervised[0])
    if len(several) > 1 and len({run.q.shape[1] for run in several}) == 1:
        drawn["comparison"] = comparison(several)
    return drawn
