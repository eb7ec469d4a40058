"""A run in one line, and in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fpid_pin.exceptions import FpidError
from fpid_pin.shown import html_table
from fpid_pin.text import shown

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run

_HEAD = ("joint", "in", "RMS", "tail", "peak error", "settled after [s]", "peak torque",
         "at its limit [%]")  # fmt: skip


def line(run: Run) -> str:
    """Return what a list of runs says of one."""
    rows, joints = run.q.shape
    about = f"{joints} joints, {rows} rows, step {run.step:g} s"
    return f"<Run {shown(run.name)}: {about}, {run.outcome}>"


def html(run: Run) -> str:
    """Return the run's metrics, a row a joint; errors in thousandths of its unit."""
    m, n = run.metrics, run.q.shape[1]
    try:
        names, units, efforts = run.arm.joint_names, run.arm.units, run.arm.effort_units
    except FpidError:  # of another version, say
        names, units, efforts = tuple(f"joint {j + 1}" for j in range(n)), ("",) * n, ("",) * n
    errors = 1e3 * m.rms, 1e3 * m.rms_tail, 1e3 * m.peak_error
    columns = (*errors, m.settling_time, m.peak_torque, 100.0 * m.saturated)
    pairs = zip(units, efforts, strict=True)
    inside = [f"m{unit}, {effort}" if unit else "?" for unit, effort in pairs]
    rows = zip(names, inside, *(column.tolist() for column in columns), strict=True)
    return html_table(f"{run.name}: {run.outcome}", _HEAD, rows)
