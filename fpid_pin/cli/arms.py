"""The body of ``fpid-pin arms``: which arms there are, with their limits and friction."""

from __future__ import annotations

import itertools

import numpy as np
from rich.table import Table

from fpid_pin.arms import Arm, catalogue
from fpid_pin.checks import FloatArray


def arms_table() -> Table:
    """Return a table of all arms that ``Arm.from_example`` knows, and the paper's own.

    Columns: name, number of joints, effort limits [N m], F_v [N m s/rad], F_d [N m], a note.
    """
    table = Table(title="Arms", title_justify="left", pad_edge=False)
    table.add_column("name", style="bold", no_wrap=True)
    table.add_column("n", justify="right")
    for heading in (
        "effort limit\nN m",
        "viscous friction\nN m s/rad",
        "dry friction\nN m",
        "note",
    ):
        table.add_column(heading)
    _row(table, "two_link", Arm.two_link(), "the paper's section 5.1, no limits given")
    for name in catalogue.names():
        _row(table, name, Arm.from_example(name), catalogue.note(name))
    return table


def _row(table: Table, name: str, arm: Arm, note: str) -> None:
    table.add_row(
        name,
        str(arm.n),
        _brief(arm.effort_limit),
        _brief(arm.viscous_friction),
        _brief(arm.dry_friction),
        note,
    )


def _brief(values: FloatArray) -> str:
    """Write equal neighbours once: ``150 x3, 28 x3``; no limit or no friction is a dash."""
    edges = [0, *(np.flatnonzero(values[1:] != values[:-1]) + 1).tolist(), values.size]
    parts = []
    for start, stop in itertools.pairwise(edges):
        value = values[start]
        text = "-" if np.isinf(value) or value == 0.0 else f"{value:g}"
        parts.append(text if stop - start == 1 else f"{text} x{stop - start}")
    whole = len(parts) == 1 and parts[0].startswith("-")
    return "-" if whole else ", ".join(parts)
