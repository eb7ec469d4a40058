"""Which arms there are by name, with their limits and friction."""

from __future__ import annotations

import itertools

import numpy as np

from fpid_pin.arms import Arm, catalogue
from fpid_pin.checks import FloatArray
from fpid_pin.cli.table import Row


def arm_rows() -> list[Row]:
    """Return a row for each arm that ``Arm.from_example`` knows, and the paper's own."""
    arms = [("two_link", Arm.two_link(), "the paper's section 5.1, no limits given")]
    arms += [(name, Arm.from_example(name), catalogue.note(name)) for name in catalogue.names()]
    return [
        {
            "name": name,
            "n": arm.n,
            "effort limit [N m]": _brief(arm.effort_limit),
            "viscous friction [N m s/rad]": _brief(arm.viscous_friction),
            "dry friction [N m]": _brief(arm.dry_friction),
            "note": note,
        }
        for name, arm, note in arms
    ]


def _brief(values: FloatArray) -> str:
    """Write equal neighbours once: ``150 x3, 28 x3``; no limit or no friction is a dash."""
    parts = []
    for value, group in itertools.groupby(values.tolist()):
        text, count = "-" if np.isinf(value) or value == 0.0 else f"{value:g}", len(list(group))
        parts.append(text if count == 1 else f"{text} x{count}")
    return "-" if len(parts) == 1 and parts[0].startswith("-") else ", ".join(parts)
