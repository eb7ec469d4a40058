"""What people write for an arm: a name, or the path of a robot's file; as an ``[arm]`` table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fpid_pin import checks
from fpid_pin.arms import Arm, names
from fpid_pin.arms.robot_descriptions import ENDING
from fpid_pin.arms.xml_text import KINDS, kind_of
from fpid_pin.descriptions import from_dict
from fpid_pin.exceptions import ArgumentError


def arm_table(text: str, locks: Sequence[str] = ()) -> dict[str, Any]:
    """Return the table of what was written for an arm.

    Parameters
    ----------
    text
        ``two_link``, a name of ``fpid-pin arms``, one of robot_descriptions, or a file's path.
    locks
        Joints to hold still, and where: ``"finger=0.02"`` [rad] or [m].

    Raises
    ------
    ArgumentError, ArmError
        Neither; a file that is not there or of no kind that is known.
    """
    table = _table(text)
    held = dict(_lock(item) for item in locks)
    return table | {"lock": held} if held else table


def find_arm(text: str, locks: Sequence[str] = ()) -> Arm:
    """Return the arm that was written: see `arm_table`."""
    return from_dict(arm_table(text, locks), Arm)


def _table(text: str) -> dict[str, Any]:
    if text == "two_link":
        return {"kind": "two_link"}
    if text in names():
        return {"kind": "example", "name": text}
    path = Path(text)
    if path.suffix or path.is_file() or len(path.parts) > 1:
        kind = KINDS[kind_of(path)][0].lower()
        return {"kind": kind, "path": text}
    if text.endswith(ENDING):
        return {"kind": "description", "name": text}
    checks.choice("arm", text, ("two_link", *names()))
    raise AssertionError(text)


def _lock(item: str) -> tuple[str, float]:
    name, sign, value = item.rpartition("=")
    try:
        if not sign:
            raise ValueError
        return name, float(value)
    except ValueError:
        raise ArgumentError("--lock", "JOINT=VALUE", repr(item)) from None
