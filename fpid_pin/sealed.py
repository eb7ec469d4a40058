"""Files of arrays and a text that know when they are damaged.

The first member of the zip lists all others with type, shape and SHA-256. A reader believes a file
once everything in it is what the list says; it takes no memory for what the file is too small for,
and hands the list with the text to whoever knows what they have to say, before it reads the rest.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import stat
import struct
import zlib
from collections.abc import Callable, Collection, Mapping
from math import prod
from pathlib import Path
from typing import Any, BinaryIO, TypeVar

import numpy as np
from numpy.typing import NDArray

from fpid_pin.archive import Member, skeleton
from fpid_pin.exceptions import ArgumentError, FileFormatError

T = TypeVar("T")
Arrays = dict[str, NDArray[Any]]

LIST, TEXT = "members", "meta"
#: A list longer than this [bytes] is none of ours.
LONGEST_LIST = 1 << 20
_MOST_DIMENSIONS, _LONGEST_NAME = 4, 100
_DTYPE = re.compile(r"<f8|<i8|\|u1|<U[1-9]\d{0,7}")  # NumPy knows no longer texts
_SHA256 = re.compile(r"[0-9a-f]{64}")
_PIECE = 1 << 20
_CUT = "something else or one that is cut short"
_ALTERED = "one that was altered"
_SIZE = "one that is cut short, or of another size than its list says"


class _Fault(Exception):
    """What came in place of a sound file."""


# ---------------------------------------------------------------------- writing


def write(file: BinaryIO, kind: str, number: int, text: str, arrays: Mapping[str, Any]) -> None:
    """Write a text and arrays of float64, int64, bytes or texts.

    Parameters
    ----------
    file
        Empty, and open for writing.
    kind, number
        What the file is, in words, and the number of its format.
    text
        Member ``meta``.
    arrays
        By name.

    Raises
    ------
    ArgumentError
        An array of another type, or a name that a file in a zip may not have.
    """
    plain = {name: _plain(name, value) for name, value in {TEXT: text, **arrays}.items()}
    members = [_sealed(name, array) for name, array in plain.items()]
    listed = [[m.name, m.dtype, list(m.shape), m.crc, m.sha256] for m in members]
    table = json.dumps({"kind": kind, "format": number, "members": listed})
    first = np.array(table.encode("ascii"))
    if first.nbytes > LONGEST_LIST:
        raise ArgumentError("arrays", f"a list of up to {LONGEST_LIST} bytes", first.nbytes)
    heads, tail = skeleton([_sealed(LIST, first), *members])
    for head, array in zip(heads, [first, *plain.values()], strict=True):
        file.write(head)
        file.write(_bytes_of(array))
    file.write(tail)


def _plain(name: str, value: Any) -> NDArray[Any]:
    array = np.asarray(value)
    wanted = {"f": "<f8", "i": "<i8", "u": "|u1", "U": f"<U{max(array.dtype.itemsize // 4, 1)}"}
    dtype = wanted.get(array.dtype.kind)
    unsigned = array.dtype.kind == "u" and array.dtype != np.uint8
    if dtype is None or unsigned or array.ndim > _MOST_DIMENSIONS:
        raise ArgumentError(
            name, f"float64, int64, bytes or texts, in {_MOST_DIMENSIONS} dimensions at most",
            f"{array.dtype} in {array.ndim}",
        )  # fmt: skip
    if not _fit(name) or name == LIST:
        raise ArgumentError(name, "a name for a file in a zip", repr(name))
    return np.asarray(array, dtype=dtype, order="C")


def _fit(name: str) -> bool:
    """Return whether a member may be called so; a zip may be unpacked by anything."""
    return name.isprintable() and 0 < len(name) <= _LONGEST_NAME and not set(name) & set('/\\:*?"')


def _bytes_of(array: NDArray[Any]) -> memoryview:
    return array.reshape(-1).view(np.uint8).data


def _sealed(name: str, array: NDArray[Any]) -> Member:
    member = Member(name, array.dtype.str, array.shape)
    data, heading = _bytes_of(array), member.heading
    whole = hashlib.sha256(heading)
    whole.update(data)
    crc = zlib.crc32(data, zlib.crc32(heading))
    return Member(name, member.dtype, member.shape, crc, whole.hexdigest())


# ---------------------------------------------------------------------- reading


def read(
    path: str | Path, kind: str, numbers: Collection[int],
    expect: Callable[[str, Mapping[str, Member]], T],
) -> tuple[Arrays, T]:  # fmt: skip
    """Return the arrays of a file, and what `expect` makes of its text and of its list.

    `numbers` are the formats that the caller knows.

    `expect` raises an `FpidError` for what it does not accept, before any other array is read.

    Raises
    ------
    FileFormatError
        Missing, cut short, altered, of another kind or format; or what `expect` finds wrong with
        the file (an `ArgumentError` or a `FileFormatError`; others go as they come).
    """
    try:
        _require_file(path)
        with open(path, "rb") as file:
            return _read(file, os.fstat(file.fileno()).st_size, kind, numbers, expect)
    except FileNotFoundError:
        raise FileFormatError(f"{path}: no such file") from None
    except OSError as error:
        raise FileFormatError(f"{path}: {error.strerror or 'cannot be read'}") from None
    except MemoryError:
        raise FileFormatError(f"{path}: does not fit into memory") from None
    except _Fault as fault:
        raise FileFormatError(f"{path}: expected a {kind}, got {fault}") from None
    except (ArgumentError, FileFormatError) as error:
        raise FileFormatError(f"{path}: {error}") from None


def _require_file(path: str | Path) -> None:
    try:
        mode = os.stat(path).st_mode
    except ValueError:  # a name with a NUL in it
        raise FileNotFoundError from None
    # A FIFO would have to be waited for, and a device may have no end.
    if not stat.S_ISREG(mode):
        raise _Fault("a folder" if stat.S_ISDIR(mode) else "a FIFO or a device")


def _read(
    file: BinaryIO, size: int, kind: str, numbers: Collection[int],
    expect: Callable[[str, Mapping[str, Member]], T],
) -> tuple[Arrays, T]:  # fmt: skip
    first, listed = _list(file, size)
    members = [first, *_members(listed, size, kind, numbers)]
    heads, tail = skeleton(members)
    starts = [0]
    for head, member in zip(heads, members, strict=True):
        starts.append(starts[-1] + len(head) + member.nbytes)
    if starts[-1] + len(tail) != size:
        raise _Fault(_SIZE)
    for start, expected in zip(starts, [*heads, tail], strict=True):
        file.seek(start)
        if file.read(len(expected)) != expected:
            raise _Fault(_ALTERED)

    def content(k: int) -> NDArray[Any]:
        file.seek(starts[k] + len(heads[k]))
        return _content(file, members[k])

    try:
        text = str(content(1))
    except ValueError:  # numbers that are no characters
        raise _Fault(_ALTERED) from None
    rest = {member.name: k for k, member in enumerate(members) if k > 1}
    found = expect(text, {name: members[k] for name, k in rest.items()})
    return {name: content(k) for name, k in rest.items()}, found


def _list(file: BinaryIO, size: int) -> tuple[Member, Any]:
    """Return the first member, and what it says."""
    name = f"{LIST}.npy".encode()
    head = file.read(30 + len(name))
    if len(head) < 30 + len(name) or head[:4] != b"PK\x03\x04":
        raise _Fault(_CUT)
    if head[30:] != name:
        raise _Fault("a zip without a list of its members: one of format 1, or repacked")
    (told,) = struct.unpack("<I", head[22:26])
    if not 12 < told <= LONGEST_LIST:
        raise _Fault(_ALTERED)
    body = file.read(told)
    if len(body) < told:
        raise _Fault(_CUT)
    text = body[10 + int.from_bytes(body[8:10], "little") :]
    if not text:
        raise _Fault(_ALTERED)
    member = Member(LIST, f"|S{len(text)}", ())
    if member.heading + text != body:
        raise _Fault(_ALTERED)
    try:
        listed = json.loads(text)
    except (ValueError, RecursionError):
        raise _Fault(_ALTERED) from None
    return Member(LIST, member.dtype, (), zlib.crc32(body)), listed


def _members(listed: Any, size: int, kind: str, numbers: Collection[int]) -> list[Member]:
    """Return the members that a list names, each of which may be in a file of `size` bytes."""
    if not isinstance(listed, dict) or listed.keys() != {"kind", "format", "members"}:
        raise _Fault(_ALTERED)
    found, version = listed["kind"], listed["format"]
    if found != kind:
        raise _Fault(f"a {found}" if isinstance(found, str) and _fit(found) else _ALTERED)
    if type(version) is not int or not 0 < version < 1000:
        raise _Fault(_ALTERED)
    if version not in numbers:
        known = " or ".join(map(str, numbers))
        raise _Fault(f"one of format {version}; format {known} is known")
    rows = listed["members"]
    if not isinstance(rows, list) or not rows:
        raise _Fault(_ALTERED)
    members = [_member(row, size) for row in rows]
    names = [member.name for member in members]
    if len(set(names)) < len(names) or names[0] != TEXT or LIST in names or members[0].shape != ():
        raise _Fault(_ALTERED)
    return members


def _member(row: Any, size: int) -> Member:
    match row:
        case [str(name), str(dtype), list(shape), int(crc), str(sha256)]:
            sound = (
                _fit(name)
                and _DTYPE.fullmatch(dtype)
                and _SHA256.fullmatch(sha256)
                and 0 <= crc < 1 << 32
                and len(shape) <= _MOST_DIMENSIONS
                and all(type(length) is int and 0 <= length < 1 << 48 for length in shape)
            )
            if sound:
                member = Member(name, dtype, tuple(shape), crc, sha256)
                # Dimensions of 0 do not make the others believable.
                if max(member.nbytes, prod(max(length, 1) for length in shape)) > size:
                    raise _Fault(_SIZE)
                return member
    raise _Fault(_ALTERED)


def _content(file: BinaryIO, member: Member) -> NDArray[Any]:
    """Read a member's data and compare it with what the list says of it."""
    array = np.empty(member.shape, member.dtype)
    data, at = _bytes_of(array), 0
    whole, crc = hashlib.sha256(member.heading), zlib.crc32(member.heading)
    while at < len(data):
        piece = data[at : at + _PIECE]
        if file.readinto(piece) != len(piece):  # type: ignore[attr-defined]
            raise _Fault(_CUT)
        whole.update(piece)
        crc = zlib.crc32(piece, crc)
        at += len(piece)
    if whole.hexdigest() != member.sha256 or crc != member.crc:
        raise _Fault(f"{_ALTERED}: {member.name!r} is not what was written")
    return array
