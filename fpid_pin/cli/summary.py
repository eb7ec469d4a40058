"""Tables of runs: a row a run, a row a run and joint, limits; for screen, Markdown and CSV."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from fpid_pin.cli.verdict import COST, Ranking, over_joints
from fpid_pin.simulation import Run, limit_report
from fpid_pin.simulation.limits import Exceedance
from fpid_pin.text import visible


@dataclass(frozen=True)
class Entry:
    """A run with its place in a comparison, and the name of its file."""

    condition: str
    controller: str
    run: Run
    file: str

    @cached_property
    def limits(self) -> list[Exceedance]:
        """What its run went beyond: tables and sentences ask for it, and it is looked for once."""
        return limit_report(self.run)


Row = dict[str, Any]
_NOT_ON_SCREEN = (
    "condition", "outcome", "file", "best", "peak error (worst joint) [mrad]",
    "settled (worst joint) [s]", "at its limit (worst joint) [%]",
    "torque rate (worst joint) [N m/s]",
)  # fmt: skip
#: Letters of a name that a table on the screen has room for in a line, at least.
_NAME = 16


def dynamics_of(entries: Sequence[Entry]) -> str:
    """Say which dynamics have made runs."""
    return f"dynamics: {entries[0].run.meta['experiment']['dynamics']}"


def run_rows(entries: Sequence[Entry], ranking: Ranking | None = None) -> list[Row]:
    """Return one row a run: figures over all joints.

    Of all joints RMS and tail are root mean squares over the joints of their RMS errors (whole
    run, last half), energy and total variation sums; what is of the worst joint is the largest.

    Parameters
    ----------
    entries
        The runs.
    ranking
        Says which runs are the best under their conditions; None: no such column.
    """
    rows = []
    for entry in entries:
        m = entry.run.metrics
        completed = entry.run.outcome.completed
        row = {
            "condition": entry.condition,
            "controller": entry.controller,
            "tail (all joints) [mrad]": over_joints(m.rms_tail) if completed else float("inf"),
            "RMS (all joints) [mrad]": over_joints(m.rms),
            "peak (worst joint) [N m]": float(m.peak_torque.max()),
            "variation (all joints) [N m]": float(m.total_variation.sum()),
            "energy (all joints) [N²m²s]": float(m.energy.sum()),
            "cost (33)": COST.of(m) if completed else float("inf"),
            "peak error (worst joint) [mrad]": 1e3 * float(m.peak_error.max()),
            "settled (worst joint) [s]": float(m.settling_time.max()),
            "at its limit (worst joint) [%]": 100.0 * float(m.saturated.max()),
            "torque rate (worst joint) [N m/s]": float(m.torque_rate.max()),
            "outcome": "completed" if completed else str(entry.run.outcome),
            "file": entry.file,
        }
        if ranking is not None:
            row["best"] = "best" if ranking.is_best(entry.condition, entry.controller) else ""
        rows.append(row)
    return rows


def joint_rows(entries: Sequence[Entry]) -> list[Row]:
    """Return one row a run and joint, every metric.

    A column's [rad] and [N m] are [m] and [N] of a joint that slides, whose name says so.
    """
    rows = []
    for entry in entries:
        m, arm = entry.run.metrics, entry.run.arm
        for j, joint in enumerate(arm.joint_names):
            rows.append(
                {
                    "condition": entry.condition,
                    "controller": entry.controller,
                    "joint": joint if arm.units[j] == "rad" else f"{joint} [m, N]",
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


def limit_rows(entries: Sequence[Entry]) -> list[Row]:
    """Return one row a limit that a run passed, or that its torque stood at."""
    return [
        {
            "condition": entry.condition,
            "controller": entry.controller,
            "joint": e.joint,
            "quantity": f"{e.quantity} [{e.unit}]",
            "limit": e.limit,
            "first [s]": e.time,
            "worst": e.value,
            "part [%]": 100.0 * e.part,
        }
        for entry in entries
        for e in entry.limits
    ]


def drop_constant(rows: list[Row], key: str) -> list[Row]:
    """Leave out a column that says the same in every row."""
    if not rows or len({row.get(key) for row in rows}) > 1:
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
    """Return a table for the screen, units under their names; a condition heads its runs.

    The best run of each condition is marked. How runs ended is left to prose; their files, and
    what a screen has no room for, to the folder's summary. Numbers are never cut or broken; names
    are, where there is no room.
    """
    from rich.table import Table
    from rich.text import Text

    table = Table(
        title=Text(visible(title), style="table.title"),
        title_justify="left",
        header_style="bold",
        box=None,
        padding=(0, 2, 0, 0),
    )
    heads = [head for head in rows[0] if head not in _NOT_ON_SCREEN]
    for head in heads:
        label = Text(head.replace(" [", "\n[").replace(" (", "\n(").replace(" joint", "\njoint"))
        numeric = _numeric(rows, head)
        if numeric:
            table.add_column(label, justify="right", no_wrap=True)
        else:
            table.add_column(label, overflow="fold", min_width=_NAME)
    condition = None
    for row in rows:
        if row.get("condition") != condition:
            condition = row["condition"]
            table.add_row(Text(visible(condition), style="bold"))
        best = bool(row.get("best"))
        cells = [Text(visible(_short(row[head]))) for head in heads]
        if best:
            cells[0].append(" *")
        table.add_row(*cells, style="bold" if best else None)
    return table


def _short(value: Any) -> str:
    """Write a value as `cell` does, with no more in an exponent than it takes: 1.143e5."""
    text = cell(value)
    if _is_number(value) and "e" in text:
        digits, _, exponent = text.partition("e")
        return f"{digits}e{int(exponent)}"
    return text


def _is_number(value: Any) -> bool:
    return isinstance(value, (float, np.floating))


def _numeric(rows: Sequence[Row], head: str) -> bool:
    return all(_is_number(row[head]) for row in rows)
