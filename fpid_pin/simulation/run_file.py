"""The file of a recorded run: what is in it, and what a reader believes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from math import prod
from pathlib import Path
from typing import Any

from fpid_pin import checks, sealed
from fpid_pin.archive import Member
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.files import replacing
from fpid_pin.packed import pack, unpack
from fpid_pin.simulation.run_table import from_json, to_json
from fpid_pin.text import listed, shown

#: Arrays as NumPy has them, or packed (`fpid_pin.packed`).
FORMAT, PACKED = 2, 3
#: A packed run takes no more than this times its file's size and so many bytes: one at rest packs
#: better by far, but so does what was made to fill a reader's memory.
MOST_RATIO, MOST_BYTES = 32, 25_000_000
KIND = "run file"
KINEMATICS = ("q", "v", "q_ref", "v_ref", "torque")
_SIGNAL = "signal_"
#: More joints than any arm has.
MOST_JOINTS = 1 << 12
_TABLES = ("versions", "experiment", "controller", "arm")


def write(
    path: Path, arrays: Mapping[str, FloatArray], signals: Mapping[str, FloatArray],
    meta: Mapping[str, Any], *, compressed: bool = False,
) -> None:  # fmt: skip
    """Write arrays and what is known of them, whole or not at all.

    A run that packs too well to be told from a bomb is written as it is.

    Raises
    ------
    ArgumentError
        What `read` would not accept.
    FileFormatError
        The file cannot be written.
    """
    rows, n = arrays["q"].shape
    members = dict(arrays) | {f"{_SIGNAL}{name}": array for name, array in signals.items()}
    shapes = {name: array.shape for name, array in members.items()}
    _check_shapes(rows, n, shapes)
    table = dict(meta) | {"format": FORMAT, "rows": rows, "joints": n}
    contents: Mapping[str, Any] = members
    if compressed:
        packed = {name: pack(array) for name, array in members.items()}
        if _bearable(shapes, sum(array.nbytes for array in packed.values())):
            contents, table = packed, table | {"format": PACKED, "shapes": shapes}
    text = to_json(table)
    # What cannot be read back must not be written.
    _check_table(from_json(text))
    with replacing(path) as temporary, open(temporary, "wb") as file:
        sealed.write(file, KIND, table["format"], text, contents)


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
        packed = table["format"] == PACKED
        for name, member in members.items():
            if member.dtype != ("|u1" if packed else "<f8") or (packed and len(member.shape) != 1):
                raise ArgumentError(name, "bytes" if packed else "float64", member.dtype)
        shapes = {name: member.shape for name, member in members.items()}
        if packed:
            size, shapes = sum(map(prod, shapes.values())), _shapes_of(table, members)
        _check_shapes(table["rows"], table["joints"], shapes)
        if packed and not _bearable(shapes, size):
            raise ArgumentError(
                "meta.rows", "as many as a file of its size may hold", table["rows"]
            )
        return dict(table)

    arrays, table = sealed.read(path, KIND, (FORMAT, PACKED), expect)
    if table["format"] == PACKED:
        arrays = {name: _unpacked(path, name, arrays[name], shape)
                  for name, shape in _shapes_of(table, arrays).items()}  # fmt: skip
        table["format"] = FORMAT
        del table["shapes"]
    signals = {
        name.removeprefix(_SIGNAL): arrays.pop(name)
        for name in list(arrays)
        if name.startswith(_SIGNAL)
    }
    return arrays, signals, table


def _bearable(shapes: Mapping[str, tuple[int, ...]], size: int) -> bool:
    """Return whether arrays of these shapes may come out of `size` bytes."""
    return sum(8 * prod(shape) for shape in shapes.values()) <= MOST_RATIO * size + MOST_BYTES


def _shapes_of(table: Mapping[str, Any], members: Iterable[str]) -> dict[str, tuple[int, ...]]:
    """Return the shapes that a table gives for packed arrays, one each."""
    shapes: Any = table.get("shapes")
    checks.instance("meta.shapes", shapes, dict, "a table")
    if list(shapes) != list(members):
        raise ArgumentError("meta.shapes", f"one for each of {listed(members)}", listed(shapes))
    for name, shape in shapes.items():
        checks.instance(f"meta.shapes.{name}", shape, list, "a list")
        for length in shape:
            checks.integer(f"meta.shapes.{name}", length, low=0, high=checks.MOST_ROWS)
    return {name: tuple(shape) for name, shape in shapes.items()}


def _unpacked(path: str | Path, name: str, packed: Any, shape: tuple[int, ...]) -> FloatArray:
    try:
        return unpack(packed, shape)
    except ValueError as error:
        raise FileFormatError(f"{path}: {name}: expected a packed array, got {error}") from None


def _check_table(table: Any) -> None:
    """Refuse numbers out of range: they decide how much memory and time a run takes later."""
    if not isinstance(table, dict):
        raise ArgumentError("meta", "the table of a run", type(table).__name__)
    number = table.get("format")
    if type(number) is not int or number not in (FORMAT, PACKED):
        raise ArgumentError("meta.format", f"{FORMAT} or {PACKED}", shown(number))
    for name in _TABLES:
        checks.instance(f"meta.{name}", table.get(name), dict, "a table")
    checks.instance("meta.name", table.get("name"), str, "a text")
    low, high = checks.STEPS
    step = checks.number("meta.step", table.get("step"), low=low, high=high)
    rows = checks.integer("meta.rows", table.get("rows"), low=0, high=checks.MOST_ROWS)
    checks.integer("meta.planned_rows", table.get("planned_rows"), low=rows, high=checks.MOST_ROWS)
    joints = checks.integer("meta.joints", table.get("joints"), low=1, high=MOST_JOINTS)
    if "effort_limit" in table:
        name = "meta.effort_limit"
        checks.instance(name, table["effort_limit"], list, "a list")
        checks.per_joint(name, table["effort_limit"], joints, low=0.0, finite=False)
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
