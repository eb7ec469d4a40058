"""The file of a recorded run: what is in it, and what a reader believes."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fpid_pin import checks, sealed
from fpid_pin.archive import Member
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.files import replacing
from fpid_pin.simulation.run_table import from_json, to_json

FORMAT = 2
KIND = "run file"
KINEMATICS = ("q", "v", "q_ref", "v_ref", "torque")
_SIGNAL = "signal_"
#: More joints than any arm has.
MOST_JOINTS = 1 << 12
_TABLES = ("versions", "experiment", "controller", "arm")


def write(
    path: Path, arrays: Mapping[str, FloatArray], signals: Mapping[str, FloatArray],
    meta: Mapping[str, Any],
) -> None:  # fmt: skip
    """Write arrays and what is known of them, whole or not at all.

    Raises
    ------
    ArgumentError
        What `read` would not accept.
    FileFormatError
        The file cannot be written.
    """
    rows, n = arrays["q"].shape
    table = dict(meta) | {"format": FORMAT, "rows": rows, "joints": n}
    text = to_json(table)
    members = dict(arrays) | {f"{_SIGNAL}{name}": array for name, array in signals.items()}
    # What cannot be read back must not be written.
    _check_table(from_json(text))
    _check_shapes(rows, n, {name: array.shape for name, array in members.items()})
    with replacing(path) as temporary, open(temporary, "wb") as file:
        sealed.write(file, KIND, FORMAT, text, members)


def read(
    path: str | Path,
) -> tuple[dict[str, FloatArray], dict[str, FloatArray], dict[str, Any]]:
    """Return the arrays, the signals and the table of a run.

    Raises
    ------
    FileFormatError
        See `sealed.read`; or its table says what no run can be.
    """

    def expect(text: str, members: Mapping[str, Member]) -> dict[str, Any]:
        try:
            table = from_json(text)
        except ValueError as error:
            raise FileFormatError(f"meta: expected the table of a run, got {error}") from None
        _check_table(table)
        for name, member in members.items():
            if member.dtype != "<f8":
                raise ArgumentError(name, "float64", member.dtype)
        shapes = {name: member.shape for name, member in members.items()}
        _check_shapes(table["rows"], table["joints"], shapes)
        return dict(table)

    arrays, table = sealed.read(path, KIND, FORMAT, expect)
    signals = {
        name.removeprefix(_SIGNAL): arrays.pop(name)
        for name in list(arrays)
        if name.startswith(_SIGNAL)
    }
    return arrays, signals, table


def _check_table(table: Any) -> None:
    """Refuse numbers out of range: they decide how much memory and time a run takes later."""
    if not isinstance(table, dict):
        raise ArgumentError("meta", "the table of a run", type(table).__name__)
    if table.get("format") != FORMAT:
        raise ArgumentError("meta.format", str(FORMAT), repr(table.get("format")))
    for name in _TABLES:
        checks.instance(f"meta.{name}", table.get(name), dict, "a table")
    checks.instance("meta.name", table.get("name"), str, "a text")
    low, high = checks.STEPS
    step = checks.number("meta.step", table.get("step"), low=low, high=high)
    rows = checks.integer("meta.rows", table.get("rows"), low=0, high=checks.MOST_ROWS)
    checks.integer("meta.planned_rows", table.get("planned_rows"), low=rows, high=checks.MOST_ROWS)
    checks.integer("meta.joints", table.get("joints"), low=1, high=MOST_JOINTS)
    _check_outcome(table.get("outcome"), step)


def _check_outcome(outcome: Any, step: float) -> None:
    checks.instance("meta.outcome", outcome, dict, "a table")
    if outcome.keys() != {"completed", "time", "joint", "cause"}:
        raise ArgumentError("meta.outcome", "completed, time, joint, cause", sorted(outcome))
    checks.instance("meta.outcome.completed", outcome["completed"], bool, "true or false")
    checks.number("meta.outcome.time", outcome["time"], low=0.0, high=step * checks.MOST_ROWS)
    for name in ("joint", "cause"):
        checks.instance(f"meta.outcome.{name}", outcome[name], str, "a text")


def _check_shapes(rows: int, n: int, shapes: Mapping[str, tuple[int, ...]]) -> None:
    for name in ("t", *KINEMATICS):
        wanted = (rows,) if name == "t" else (rows, n)
        if shapes.get(name) != wanted:
            raise ArgumentError(name, f"float64 of shape {wanted}", f"shape {shapes.get(name)}")
    for name, shape in shapes.items():
        known = name in ("t", *KINEMATICS)
        if not known and (not name.startswith(_SIGNAL) or shape not in ((rows,), (rows, n))):
            raise ArgumentError(name, f"a signal with {rows} rows", f"shape {shape}")
