"""A run in one line, and in a notebook."""

from __future__ import annotations

from typing import TYPE_CHECKING

from fpid_pin.exceptions import FpidError
from fpid_pin.shown import html_table
from fpid_pin.text import shown

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run

_HEAD = ("joint", "RMS [mrad]", "tail [mrad]", "peak error [mrad]", "settled after [s]",
         "peak torque [N m]", "at its limit [%]")  # fmt: skip


def line(run: Run) -> str:
    """Return what a list of runs says of one."""
    rows, joints = run.q.shape
    about = f"{joints} joints, {rows} rows, step {run.step:g} s"
    return f"<Run {shown(run.name)}: {about}, {run.outcome}>"


def html(run: Run) -> str:
    """Return the run's metrics, a row a joint."""
    m = run.metrics
    try:
        names = run.arm.joint_names
    except FpidError:  # of another version, say
        names = tuple(f"joint {j + 1}" for j in range(run.q.shape[1]))
    rows = [
        (name, *map(float, (
            1e3 * m.rms[j], 1e3 * m.rms_tail[j], 1e3 * m.peak_error[j], m.settling_time[j],
            m.peak_torque[j], 100.0 * m.saturated[j],
        )))
        for j, name in enumerate(names)
    ]  # fmt: skip
    return html_table(f"{run.name}: {run.outcome}", _HEAD, rows)
