"""Figures of runs, and those of `maps`; each function returns a `Figure`, without pyplot."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.control.gains import SuggestedFpid
from fpid_pin.costs import METRICS
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.simulation.run import Run
from fpid_pin.text import cut, percent, unit_for
from fpid_pin.view import style
from fpid_pin.view.maps import convergence as convergence
from fpid_pin.view.maps import cost_map as cost_map
from fpid_pin.view.maps import heat_map as heat_map
from fpid_pin.view.maps import profile as profile

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

GAINS = (("kp", "$K_P$"), ("ki", "$K_I$"), ("kd", "$K_D$"))
ORDERS = (("integral_order", r"$\lambda$"), ("derivative_order", r"$\mu$"))
# Of the gains over rad, and over rad and the scale's kg m^2.
_GAIN_UNITS = ("N m/rad", r"N m/(rad s$^\lambda$)", r"N m s$^\mu$/rad")
_SCALED_UNITS = ("s$^{-2}$", r"s$^{-2-\lambda}$", r"s$^{\mu-2}$")
_LIMIT: dict[str, Any] = {"color": style.PALETTE[1], "linestyle": ":"}
_WIDTH = 7.0
# The other run, where it is there to be compared with.
_BENEATH: dict[str, Any] = {"color": "#9a9a9a", "linewidth": 0.9, "zorder": 1}
# More joints than this share a row of panels rather than take one each.
_TALL = 4
# Letters of a name above a panel that is half as wide as a page.
_LONG = 30


def has_all(run: Run, signals: Sequence[tuple[str, str]]) -> bool:
    """Whether a run recorded all of these: `GAINS`, or `ORDERS`, which are those that moved."""
    return all(name in run.signals for name, _ in signals)


def _has_supervisor(run: Run) -> bool:
    given = run.meta["controller"].get("supervisor") is not None
    return given and {"lyapunov", "u_s"} <= set(run.signals)


def _of_one_size(runs: Run | Sequence[Run]) -> list[Run]:
    several = style.as_runs(runs)
    if not several:
        raise ArgumentError("runs", "at least one run", "none")
    counts = list(dict.fromkeys(run.q.shape[1] for run in several))
    if len(counts) > 1:
        raise ArgumentError("runs", "one number of joints", ", ".join(map(str, counts)))
    return several


# ------------------------------------------------------------------ a panel for each joint


def _by_joint(
    runs: Sequence[Run], quantities: Sequence[str], height: float, looks: Sequence[dict[str, Any]]
) -> tuple[Figure, list[Axes]]:
    """Draw quantities of runs, a panel a joint under its name, in one column or two."""
    arm = runs[0].arm
    names, count = style.lettered(arm), arm.n * len(quantities)
    columns = 2 if len(quantities) > 1 or count > _TALL else 1
    rows = -(-count // columns)
    width = _WIDTH if columns == 1 else 1.35 * _WIDTH
    figure, panels = style.new_figure(rows, columns, width, 0.5 + height * rows, count=count)
    for k, panel in enumerate(panels):
        j, quantity = k // len(quantities), quantities[k % len(quantities)]
        for run, look in zip(runs, looks, strict=True):
            style.line(panel, run.t, getattr(run, quantity)[:, j], **look)
        panel.set_ylabel(style.axis_label(arm, quantity, j))
        if quantity == quantities[0]:
            panel.set_title(names[j])
    for bottom in panels[-columns:]:
        bottom.set_xlabel("time, s")
        bottom.tick_params(labelbottom=True)
    return figure, panels


@style.styled
def tracking(run: Run) -> Figure:
    """Draw each joint's angle and its reference over time."""
    figure, panels = _by_joint([run], ["q"], 1.6, [{"label": "actual"}])
    for j, panel in enumerate(panels):
        style.line(panel, run.t, run.q_ref[:, j], "desired", **style.REFERENCE)
    style.legend(panels[0], 2)
    return figure


@style.styled
def error(runs: Run | Sequence[Run]) -> Figure:
    """Draw each joint's tracking error, of one run or several."""
    several = _of_one_size(runs)
    figure, _ = _by_joint(several, ["error"], 1.5, style.looks_of(several))
    if len(several) > 1:
        style.shared_legend(figure, style.captions_of(several, None))
    return figure


@style.styled
def torque(run: Run) -> Figure:
    """Draw each joint's torque, with its limit where there is one: a line where it is near."""
    figure, panels = _by_joint([run], ["torque"], 1.5, [{"label": "applied"}])
    arm = run.arm
    for j, (panel, limit) in enumerate(zip(panels, arm.effort_limit, strict=True)):
        if np.abs(run.torque[:, j]).max(initial=0.0) > 0.25 * limit:
            panel.axhline(limit, label="limit", **_LIMIT)
            panel.axhline(-limit, **_LIMIT)
        elif np.isfinite(limit):
            panel.set_title(f"limit $\\pm${limit:g} {arm.effort_units[j]}", loc="right",
                            fontsize=8, fontweight="normal")  # fmt: skip
    if (limited := np.isfinite(arm.effort_limit)).any():
        style.legend(panels[int(np.argmax(limited))], 2)
    return figure


@style.styled
def comparison(runs: Sequence[Run]) -> Figure:
    """Draw several runs over each other: error and torque of every joint."""
    several = _of_one_size(runs)
    figure, _ = _by_joint(several, ["error", "torque"], 1.5, style.looks_of(several))
    style.shared_legend(figure, style.captions_of(several, None))
    return figure


@style.styled
def phase_plane(run: Run) -> Figure:
    """Draw each joint's error rate over its error, from start (ring) to end (dot)."""
    arm, n = run.arm, run.arm.n
    columns = min(n, 3)
    rows = -(-n // columns)
    size = 2.4 * columns + 0.4, 2.3 * rows
    figure, panels = style.new_figure(rows, columns, *size, count=n, share_x=False)
    e, rate, stride = run.error, run.v_ref - run.v, max(len(run.t) // 6000, 1)
    for j, (panel, name) in enumerate(zip(panels, style.lettered(arm), strict=True)):
        unit = arm.units[j]
        panel.plot(e[::stride, j], rate[::stride, j], linewidth=0.9)
        panel.plot(e[0, j], rate[0, j], "o", color=style.INK, fillstyle="none", markersize=5)
        panel.plot(e[-1, j], rate[-1, j], "o", color=style.PALETTE[1], markersize=4)
        panel.set(title=name, xlabel=f"error $e$, {unit}", ylabel=f"$\\dot e$, {unit}/s")
    return figure


# ------------------------------------------------------------------ a panel for all joints


def _all_joints(axes: Axes, run: Run, name: str) -> None:
    for j, joint in enumerate(style.lettered(run.arm)):
        style.line(axes, run.t, run.signals[name][:, j], joint)


@style.styled
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
    orders = ORDERS if has_all(run, ORDERS) else ()
    count = 3 + len(orders)
    figure, panels = style.new_figure(count, 1, _WIDTH, 5.0 * count / 3)
    angles = run.arm.units
    own = [unit_for(unit, angles) for unit in _GAIN_UNITS]
    units = (*(_SCALED_UNITS if scaled else own), "", "")
    for panel, (name, label), unit in zip(panels, (*GAINS, *orders), units, strict=False):
        _all_joints(panel, run, name)
        panel.set_ylabel(f"{label}, {unit}".removesuffix(", "))
        if not unit:
            panel.set_ylim(-0.03, 1.03)
    panels[0].set_title(style.lettering(run.name))
    style.legend(panels[0], min(run.q.shape[1], 4))
    panels[-1].set_xlabel("time, s")
    return figure


@style.styled
def lyapunov(run: Run) -> Figure:
    """Draw the supervisor's V over time with its threshold V_M, eq. (16), and the torque it gave.

    Raises
    ------
    ArgumentError
        The run's controller had no supervisor.
    """
    if not _has_supervisor(run):
        raise ArgumentError("run", "a run with a supervisor", "one without")
    figure, (upper, lower) = style.new_figure(2, 1, _WIDTH, 3.8)
    style.line(upper, run.t, run.signals["lyapunov"], "$V$")
    with contextlib.suppress(KeyError, FpidError):  # a law that cannot be made again
        supervisor = run.controller.supervisor
        if supervisor is not None:
            upper.axhline(supervisor.threshold, label="$V_M$", **_LIMIT)
    upper.set(ylabel="$V$", title=f"{style.lettering(run.name)}: Lyapunov function")
    style.legend(upper, 2)
    _all_joints(lower, run, "u_s")
    part = 100.0 * float((run.signals["u_s"] != 0.0).any(axis=1).mean())
    lower.set(
        ylabel=f"$u_s$, {unit_for('N m', run.arm.units)}", xlabel="time, s",
        title=f"supervisor, acting {part:.3g} % of the time",
    )  # fmt: skip
    style.legend(lower, min(run.q.shape[1], 4))
    return figure


@style.styled
def plot(run: Run) -> Figure:
    """Draw a run at a glance: angles and references, errors, torques, gains where it has any.

    Orders that move have a panel, too.
    """
    kinds = {"gains": GAINS, "orders": ORDERS}
    kinds = {title: kind for title, kind in kinds.items() if has_all(run, kind)}
    rows = 3 + len(kinds)
    figure, panels = style.new_figure(rows, 1, _WIDTH, 1.7 * rows + 0.3)
    style.overview(run, panels[:3])
    figure.suptitle(f"{style.lettering(run.name)}: {style.lettering(run.outcome)}", fontsize=10)
    for panel, (title, kind) in zip(panels[3:], kinds.items(), strict=True):
        for (name, label), dash in zip(kind, ("-", "--", ":"), strict=False):
            for j in range(run.q.shape[1]):
                look = {"color": style.colour(j), "linestyle": dash}
                style.line(panel, run.t, run.signals[name][:, j], "" if j else label, **look)
        panel.set_ylabel(title)
        style.legend(panel, 3)
    panels[-1].set_xlabel("time, s")
    return figure


@style.styled
def response(run: Run, heading: str = "") -> Figure:
    """Draw the panels of Figs. 4 and 5: (a) tracking, (b) control signals, (c) errors.

    Parameters
    ----------
    run
        What to draw; all joints share each panel.
    heading
        Above the figure; the run's name if empty.
    """
    figure, (track, control, e) = style.new_figure(3, 1, 6.6, 6.6)
    style.overview(run, (track, e, control))
    track.set_title("(a) tracking")
    control.set_title("(b) control signals")
    e.set(title="(c) tracking errors", xlabel="time, s")
    figure.suptitle(style.lettering(heading or run.name), fontsize=10)
    return figure


@style.styled
def orders(integer: Run, fractional: Run) -> Figure:
    """Draw Figs. 4 and 5 beside each other, each row of panels on one scale.

    On the right the integer run is grey beneath the fractional one. Marked are the largest torque
    and the half of the run whose RMS error is given, with what has changed from left to right.
    """
    figure, panels = style.new_figure(3, 2, 1.35 * _WIDTH, 6.6, share_y="row")
    arm, several = fractional.arm, (integer, fractional)
    for k, run in enumerate(several):
        track, control, e = panels[k::2]
        style.overview(run, (track, e, control))
        peak = np.unravel_index(np.abs(run.torque).argmax(), run.torque.shape)
        control.plot(run.t[peak[0]], run.torque[peak], "o", color=style.INK, fillstyle="none")
        e.axvspan(run.t[len(run.t) // 2], run.t[-1], color=style.INK, alpha=0.06, linewidth=0)
        e.set_xlabel("time, s")
        track.legend([]).remove()
        kind = ("Integer orders (Fig. 4)", "Fractional orders (Fig. 5)")[k]
        track.set_title(f"{kind}: {style.lettering(cut(run.name, _LONG))}")
    efforts = ", ".join(dict.fromkeys(arm.effort_units))
    units = ", ".join(dict.fromkeys(f"m{unit}" for unit in arm.units))
    for row, (quantity, title, metric, size, unit) in enumerate((
        ("torque", "(b) control signals, peak", "peak_torque", 1.0, efforts),
        ("error", "(c) errors, RMS of the last half", "rms_tail", 1e3, units),
    ), start=1):  # fmt: skip
        left, right = panels[2 * row : 2 * row + 2]
        for j in range(arm.n):
            beneath = getattr(integer, quantity)[:, j]
            style.line(right, integer.t, beneath, "integer orders", **_BENEATH)
        old, new = (size * METRICS[metric].of(getattr(run.metrics, metric)) for run in several)
        change = new / old - 1.0 if old else np.nan
        more = f": {percent(abs(change))} {'more' if change > 0.0 else 'less'}"
        left.set_title(f"{title} {old:.3g} {unit}")
        right.set_title(f"{new:.3g} {unit}{more if np.isfinite(change) else ''}")
    handles, names = panels[0].get_legend_handles_labels()
    style.shared_legend(figure, [*names, "integer orders"], [*handles, panels[-1].get_lines()[-1]])
    return figure


def is_integer(run: Run) -> bool:
    """Whether a run's controller is of integer orders (or has no orders at all)."""
    table = run.meta["controller"]
    orders = [table.get(f"{kind}_order", 1.0) for kind in ("integral", "derivative")]
    return all(bool((np.asarray(order, dtype=np.float64) == 1.0).all()) for order in orders)


def figures(runs: Run | Sequence[Run]) -> dict[str, Figure]:
    """Return the figures of an experiment by name.

    ``fig4`` is the first integer-order run and ``fig5`` the first fractional one, as in the paper,
    ``orders`` both beside each other;
    ``gains`` those of the fractional run (else of the first that has any), ``lyapunov`` its
    supervisor, ``comparison`` all runs. What the runs do not hold is left out.
    """
    several = style.as_runs(runs)
    integer = [run for run in several if is_integer(run)]
    fractional = [run for run in several if not is_integer(run)]
    drawn: dict[str, Figure] = {}
    if integer and fractional and integer[0].q.shape[1] == fractional[0].q.shape[1]:
        drawn["orders"] = orders(integer[0], fractional[0])
    if integer:
        drawn["fig4"] = response(integer[0], f"Integer orders: {integer[0].name}")
    if fractional:
        drawn["fig5"] = response(fractional[0], f"Fractional orders: {fractional[0].name}")
    first = [*fractional, *integer]
    for run in [run for run in first if has_all(run, GAINS)][:1]:
        drawn["gains"] = gains(run)
    for run in [run for run in first if _has_supervisor(run)][:1]:
        drawn["lyapunov"] = lyapunov(run)
    if len(several) > 1 and len({run.q.shape[1] for run in several}) == 1:
        drawn["comparison"] = comparison(several)
    return drawn
