"""What people write for an arm: a name, or the path of a robot's file; as an ``[arm]`` table."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from fpid_pin import checks
from fpid_pin.arms import Arm, names
from fpid_pin.arms.robot_descriptions import ENDING
from fpid_pin.arms.robot_file import KINDS, kind_of
from fpid_pin.arms.tables import arm_of
from fpid_pin.arms.tree import HoldError
from fpid_pin.exceptions import ArgumentError


def arm_table(
    text: str,
    locks: Sequence[str] = (),
    keep: str | None = None,
    package_dirs: Sequence[Path] = (),
    tool: str | None = None,
    inertia: str | None = None,
) -> dict[str, Any]:
    """Return the table of what was written for an arm, with the options of the command line.

    `text` is ``two_link``, a name of ``fpid-pin arms`` or robot_descriptions, or a file's path.
    """
    given = {
        "lock": dict(_lock(item) for item in locks),
        "keep": keep,
        "package_dirs": [str(folder.resolve()) for folder in package_dirs],
        "tool": tool,
        "inertia": inertia,
    }
    return _table(text) | {key: value for key, value in given.items() if value}


def arm_of_table(table: dict[str, Any]) -> Arm:
    """Build the arm of `arm_table`; an error's hint is written as the command line has it."""
    try:
        return arm_of(table)
    except HoldError as error:
        raise error.on_command_line() from None


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
