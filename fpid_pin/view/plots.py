"""Figures of runs; each function returns a matplotlib `Figure` without touching pyplot."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.control.suggested import SuggestedFpid
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.run import Run
from fpid_pin.view.palette import colour
from fpid_pin.view.panels import (
    GAIN_UNITS,
    GAINS,
    ORDERS,
    REFERENCE,
    WIDTH,
    draw_torque,
    draw_tracking,
    grid,
    has_gains,
    has_orders,
    has_supervisor,
    joint_units,
    legend,
    lettered_names,
    limits_of,
    line,
    looks_of,
    require_same_joints,
    shared_legend,
    shared_units,
    threshold_of,
)
from fpid_pin.view.ranking import heat_map
from fpid_pin.view.scene import as_runs, captions_of
from fpid_pin.view.searches import convergence, cost_map, profile
from fpid_pin.view.style import figure_bytes, lettering, new_figure, save_figure, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = [
    "comparison",
    "convergence",
    "cost_map",
    "error",
    "figure_bytes",
    "gains",
    "heat_map",
    "lyapunov",
    "phase_plane",
    "plot",
    "profile",
    "save_figure",
    "torque",
    "tracking",
]


def _effort(units: str) -> str:
    """Return the label of an axis of torques [N m], forces [N] or, of a shared panel, both."""
    return f"{'force' if units == 'N' else 'torque'}, {units}"


@styled
def tracking(run: Run) -> Figure:
    """Draw each joint's angle and its reference over time."""
    figure, axes = grid(run, 1.6)
    units = joint_units(run)
    for j, (panel, name) in enumerate(zip(axes, lettered_names(run), strict=True)):
        draw_tracking(panel, run, j)
        unit, _ = units[j]
        panel.set(title=name, ylabel=f"{'angle' if unit == 'rad' else 'position'}, {unit}")
    legend(axes[0], 2)
    return figure


@styled
def error(runs: Run | Sequence[Run]) -> Figure:
    """Draw each joint's tracking error, of one run or several."""
    several = as_runs(runs)
    require_same_joints(several)
    figure, axes = grid(several[0], 1.5)
    looks, units = looks_of(several), joint_units(several[0])
    for j, (panel, name) in enumerate(zip(axes, lettered_names(several[0]), strict=True)):
        for run, look in zip(several, looks, strict=True):
            line(panel, run.t, run.error[:, j], **look)
        panel.set(title=name, ylabel=f"$q_d - q$, {units[j][0]}")
    if len(several) > 1:
        shared_legend(figure, captions_of(several, None))
    return figure


@styled
def torque(run: Run) -> Figure:
    """Draw each joint's torque, with its limit where there is one."""
    figure, axes = grid(run, 1.5)
    limits, units = limits_of(run), joint_units(run)
    for j, (panel, name) in enumerate(zip(axes, lettered_names(run), strict=True)):
        draw_torque(panel, run, j, float(limits[j]))
        panel.set(title=name, ylabel=_effort(units[j][1]))
    if np.isfinite(limits).any():
        legend(axes[int(np.argmax(np.isfinite(limits)))], 2)
    return figure


@styled
def gains(run: Run) -> Figure:
    """Draw the adapted gains K_P, K_I, K_D of every joint over time, and orders where they move.

    Raises
    ------
    ArgumentError
        The run's controller has no such gains.
    """
    if not has_gains(run):
        raise ArgumentError(
            "run", "a run that recorded kp, ki, kd", f"one with {sorted(run.signals)}"
        )
    curves: tuple[tuple[str, str], ...] = GAINS
    units: tuple[str, ...] = GAIN_UNITS["scaled" if _is_scaled(run.meta["controller"]) else "none"]
    if has_orders(run):
        curves, units = (*GAINS, *ORDERS), (*units, "", "")
    figure, axes = new_figure(len(curves), 1, WIDTH, 5.0 * len(curves) / len(GAINS))
    for (panel,), (name, label), unit in zip(axes, curves, units, strict=True):
        for j, joint in enumerate(lettered_names(run)):
            line(panel, run.t, run.signals[name][:, j], joint)
        panel.set(ylabel=f"{label}, {unit}".removesuffix(", "))
        if not unit:
            panel.set_ylim(-0.03, 1.03)
    axes[0][0].set_title(lettering(run.name))
    legend(axes[0][0], min(run.q.shape[1], 4))
    axes[-1][0].set_xlabel("time, s")
    return figure


def _is_scaled(controller: dict[str, Any]) -> bool:
    """Return whether a law's gains are over its joints' inertias."""
    suggested = controller.get("kind") == SuggestedFpid._kind  # type: ignore[attr-defined]
    return bool(suggested or controller.get("scale", "none") != "none")


@styled
def phase_plane(run: Run) -> Figure:
    """Draw each joint's error rate over its error, from start (ring) to end (dot)."""
    n = run.q.shape[1]
    columns = min(n, 3)
    rows = -(-n // columns)
    figure, axes = new_figure(rows, columns, 2.4 * columns + 0.4, 2.3 * rows, share_x=False)
    flat = [a for row in axes for a in row]
    for spare in flat[n:]:
        spare.set_visible(False)
    e, rate, units = run.error, run.v_ref - run.v, joint_units(run)
    for j, (panel, name) in enumerate(zip(flat, lettered_names(run), strict=False)):
        stride = max(len(run.t) // 6000, 1)
        panel.plot(e[::stride, j], rate[::stride, j], linewidth=0.9)
        panel.plot(e[0, j], rate[0, j], "o", color="#262626", fillstyle="none", markersize=5)
        panel.plot(e[-1, j], rate[-1, j], "o", color="#D55E00", markersize=4)
        unit, _ = units[j]
        panel.set(title=name, xlabel=f"error $e$, {unit}", ylabel=f"$\\dot e$, {unit}/s")
    return figure


@styled
def lyapunov(run: Run) -> Figure:
    """Draw the supervisor's V over time with its threshold V_M, and the torque it gave.

    Raises
    ------
    ArgumentError
        The run's controller had no supervisor.
    """
    if not has_supervisor(run):
        raise ArgumentError("run", "a run with a supervisor", "one without")
    figure, axes = new_figure(2, 1, WIDTH, 3.8)
    (upper,), (lower,) = axes
    line(upper, run.t, run.signals["lyapunov"], "$V$")
    threshold = threshold_of(run)
    if threshold is not None:
        upper.axhline(threshold, label="$V_M$", color="#D55E00", linestyle=":")
    upper.set(ylabel="$V$", title=f"{lettering(run.name)}: Lyapunov function")
    legend(upper, 2)
    for j, name in enumerate(lettered_names(run)):
        line(lower, run.t, run.signals["u_s"][:, j], name)
    acting = np.abs(run.signals["u_s"]).max(axis=1) > 0.0
    part = 100.0 * float(acting.mean())
    lower.set(
        ylabel="$u_s$, N m", xlabel="time, s", title=f"supervisor, acting {part:.3g} % of the time"
    )
    legend(lower, min(run.q.shape[1], 4))
    return figure


@styled
def comparison(runs: Sequence[Run]) -> Figure:
    """Draw several runs over each other: error and torque of every joint."""
    several = as_runs(runs)
    require_same_joints(several)
    n, looks, units = several[0].q.shape[1], looks_of(several), joint_units(several[0])
    figure, axes = new_figure(n, 2, 1.35 * WIDTH, 0.6 + 1.5 * n)
    for j, name in enumerate(lettered_names(several[0])):
        left, right = axes[j]
        for run, look in zip(several, looks, strict=True):
            line(left, run.t, run.error[:, j], **look)
            line(right, run.t, run.torque[:, j], **look)
        unit, effort = units[j]
        left.set(title=name, ylabel=f"$q_d - q$, {unit}")
        right.set(ylabel=_effort(effort))
    for panel in axes[-1]:
        panel.set_xlabel("time, s")
    shared_legend(figure, captions_of(several, None))
    return figure


@styled
def plot(run: Run) -> Figure:
    """Draw a run at a glance: angles and references, errors, torques, gains where it has any.

    Orders that move have a panel, too.
    """
    n, names = run.q.shape[1], lettered_names(run)
    rows = 3 + has_gains(run) + has_orders(run)
    figure, axes = new_figure(rows, 1, WIDTH, 1.7 * rows + 0.3)
    angle, e, u, *more = (row[0] for row in axes)
    for j, name in enumerate(names):
        line(angle, run.t, run.q[:, j], name, color=colour(j))
        line(angle, run.t, run.q_ref[:, j], "desired" if j == n - 1 else "", **REFERENCE)
        line(e, run.t, run.error[:, j])
        line(u, run.t, run.torque[:, j])
    unit, effort = shared_units(run)
    angle.set(ylabel=f"{'angle' if unit == 'rad' else 'position'}, {unit}")
    figure.suptitle(f"{lettering(run.name)}: {lettering(run.outcome)}", fontsize=10)
    legend(angle, min(n + 1, 4))
    e.set(ylabel=f"$q_d - q$, {unit}")
    u.set(ylabel=_effort(effort))
    kinds = [kind for kind in (GAINS, ORDERS) if all(name in run.signals for name, _ in kind)]
    for panel, kind, title in zip(more, kinds, ("gains", "orders"), strict=False):
        for j in range(n):
            for (name, label), dash in zip(kind, ("-", "--", ":"), strict=False):
                shown = label if j == 0 else ""
                look = {"color": colour(j), "linestyle": dash}
                line(panel, run.t, run.signals[name][:, j], shown, **look)
        panel.set(ylabel=title)
        legend(panel, 3)
    axes[-1][0].set_xlabel("time, s")
    return figure
