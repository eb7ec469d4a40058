"""An arm in a notebook: its joints and what limits them."""

from __future__ import annotations

from typing import Any

from fpid_pin.shown import html_table

_FIELDS = ("lower", "upper", "velocity_limit", "effort_limit", "viscous_friction", "dry_friction",
           "home")  # fmt: skip


def joint_table(arm: Any) -> str:
    """Return the joints of an `Arm` as HTML, a row each, with the units of its numbers."""
    columns = [getattr(arm, name).tolist() for name in _FIELDS]
    caption = f"{arm.name}: {arm.n} joints, tool {arm.tool}"
    heads = ("joint", "in (rates per s)", *(name.replace("_", " ") for name in _FIELDS))
    units = [", ".join(pair) for pair in zip(arm.units, arm.effort_units, strict=True)]
    return html_table(caption, heads, zip(arm.joint_names, units, *columns, strict=True))
