"""An arm in a notebook: its joints and what limits them."""

from __future__ import annotations

from typing import Any

from fpid_pin.shown import html_table

_FIELDS = {
    "lower": "lower [rad]", "upper": "upper [rad]", "velocity_limit": "velocity limit [rad/s]",
    "effort_limit": "effort limit [N m]", "viscous_friction": "viscous friction [N m s/rad]",
    "dry_friction": "dry friction [N m]", "home": "home [rad]",
}  # fmt: skip


def joint_table(arm: Any) -> str:
    """Return the joints of an `Arm` as HTML, a row each."""
    columns = [getattr(arm, name).tolist() for name in _FIELDS]
    caption = f"{arm.name}: {arm.n} joints, tool {arm.tool}"
    rows = zip(arm.joint_names, *columns, strict=True)
    return html_table(caption, ("joint", *_FIELDS.values()), rows)
