"""Tables of runs: one row a run, and one row a run and joint; for screen, Markdown and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.simulation import Run, limit_report
from fpid_pin.text import visible


@dataclass(frozen=True)
class Entry:
    """A run with its place in a comparison, and the name of its file."""

    condition: str
    controller: str
    run: Run
    file: str


Row = dict[str, Any]
_NOT_ON_SCREEN = (
    "outcome", "file", "peak error (worst joint) [mrad]", "settled (worst joint) [s]",
    "at its limit (worst joint) [%]", "torque rate (worst joint) [N m/s]",
)  # fmt: skip


def run_rows(entries: Sequence[Entry], cost: Cost | None = None) -> list[Row]:
    """Return one row a run: figures over all joints.

    Of all joints RMS and tail are root mean squares over the joints of their RMS errors (whole
    run, last half), energy and total variation sums; what is of the worst joint is the largest.

    Parameters
    ----------
    entries
        The runs.
    cost
        None: eq. (33) with its default weights.
    """
    cost = cost or QuadraticCost()
    rows = []
    for entry in entries:
        m = entry.run.metrics
        completed = entry.run.outcome.completed
        rows.append(
            {
                "condition": entry.condition,
                "controller": entry.controller,
                "cost (33)": cost.of(m) if completed else float("inf"),
                "RMS (all joints) [mrad]": 1e3 * float(np.sqrt(np.mean(m.rms**2))),
                "tail (all joints) [mrad]": 1e3 * float(np.sqrt(np.mean(m.rms_tail**2))),
                "energy (all joints) [N²m²s]": float(m.energy.sum()),
                "variation (all joints) [N m]": float(m.total_variation.sum()),
                "peak (worst joint) [N m]": float(m.peak_torque.max()),
                "peak error (worst joint) [mrad]": 1e3 * float(m.peak_error.max()),
                "settled (worst joint) [s]": float(m.settling_time.max()),
                "at its limit (worst joint) [%]": 100.0 * float(m.saturated.max()),
                "torque rate (worst joint) [N m/s]": float(m.torque_rate.max()),
                "outcome": "completed" if completed else str(entry.run.outcome),
                "file": entry.file,
            }
        )
    return rows


def joint_rows(entries: Sequence[Entry]) -> list[Row]:
    """Return one row a run and joint, every metric."""
    rows = []
    for entry in entries:
        m, names = entry.run.metrics, entry.run.arm.joint_names
        for j, joint in enumerate(names):
            rows.append(
                {
                    "condition": entry.condition,
                    "controller": entry.controller,
                    "joint": joint,
                    "RMS [rad]": m.rms[j],
                    "RMS tail [rad]": m.rms_tail[j],
                    "ISE [rad^2 s]": m.ise[j],
                    "IAE [rad s]": m.iae[j],
                    "ITAE [rad s^2]": m.itae[j],
                    "energy [N²m²s]": m.energy[j],
                    "variation [N m]": m.total_variation[j],
                    "peak torque [N m]": m.peak_torque[j],
                    "peak error [rad]": m.peak_error[j],
                    "settled [s]": m.settling_time[j],
                    "overshoot [rad]": m.overshoot[j],
                    "at its limit [%]": 100.0 * m.saturated[j],
                    "torque rate [N m/s]": m.torque_rate[j],
                }
            )
    return rows


def remarks(entries: Sequence[Entry]) -> list[str]:
    """Return what a table does not say: runs that ended early, and limits that were passed."""
    lines = []
    for entry in entries:
        label = f"{entry.controller}, {entry.condition}"
        if not entry.run.outcome.completed:
            lines.append(f"{label}: {entry.run.outcome}")
        lines += [f"{label}: {exceedance}" for exceedance in limit_report(entry.run)]
    return lines


def drop_constant(rows: list[Row], key: str) -> list[Row]:
    """Leave out a column that says the same in every row."""
    if len({row[key] for row in rows}) > 1:
        return rows
    return [{k: v for k, v in row.items() if k != key} for row in rows]


def cell(value: Any) -> str:
    """Write a value with four significant digits."""
    return f"{float(value):.4g}" if isinstance(value, (float, np.floating)) else str(value)


def markdown(rows: Sequence[Row]) -> str:
    """Return a Markdown table."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |"]
    lines.append("|" + "|".join(" ---: " if _numeric(rows, h) else " --- " for h in heads) + "|")
    for row in rows:
        cells = [in_markdown(cell(row[h])) for h in heads]
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def in_markdown(text: str) -> str:
    """Return text that Markdown takes for text: one line, no mark-up, link or end of a cell."""
    # Spaces before it would make code of it.
    return _LEADS.sub(r"\1\\\2", _MARKS.sub(r"\\\g<0>", visible(text).strip()))


# What Markdown may take for its own; an underscore within a word it leaves alone. At the start of
# a line these make lists, rules and headings.
_MARKS = re.compile(r"[\\`*\[\]<>|&~$#]|(?<![^\W_])_|_(?![^\W_])")
_LEADS = re.compile(r"^(\d*)([-+.)])(?=[\s-]|$)")


def comma_separated(rows: Sequence[Row]) -> str:
    """Return CSV with every digit."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    for row in rows:
        writer.writerow({k: repr(float(v)) if _is_number(v) else v for k, v in row.items()})
    return text.getvalue()


def rich_table(rows: Sequence[Row], title: str) -> Any:
    """Return a table for the screen, units under their names.

    How runs ended is left to prose; their files, and what a screen has no room for, to the
    folder's summary.
    """
    from rich.table import Table
    from rich.text import Text

    rows = [{k: value for k, value in row.items() if k not in _NOT_ON_SCREEN} for row in rows]
    table = Table(
        title=Text(visible(title), style="table.title"),
        title_justify="left",
        header_style="bold",
        box=None,
        padding=(0, 2, 0, 0),
    )
    for head in rows[0]:
        justify: Any = "right" if _numeric(rows, head) else "left"
        table.add_column(
            Text(head.replace(" [", "\n[").replace(" (", "\n(").replace(" joint", "\njoint")),
            justify=justify,
            no_wrap=head == "controller",
        )
    for row in rows:
        table.add_row(*(Text(visible(cell(value))) for value in row.values()))
    return table


def _is_number(value: Any) -> bool:
    return isinstance(value, (float, np.floating))


def _numeric(rows: Sequence[Row], head: str) -> bool:
    return all(_is_number(row[head]) for row in rows)
