"""A zip of arrays (.npz) that has one form only: all bytes but the data follow from its members.

NumPy and any zip tool read such a file. Whoever knows its members need not parse it: the bytes
that they call for either are there or are not. The zip compresses nothing, so that no file is
smaller than what is in it.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from math import prod

import numpy as np

#: From this size on positions and sizes are written with 64 bits.
NARROW = 0xFFFF_0000
_ALL = 0xFFFF_FFFF
_DATE = 0x21  # the first day that the format knows: the same members are the same file


@dataclass(frozen=True)
class Member:
    """An array of the file.

    Attributes
    ----------
    name
        Without its ``.npy``.
    dtype
        As NumPy writes it: ``<f8``, ``<i8``, ``<U12``, ``|S12``.
    shape
        Of the array.
    crc, sha256
        Of its file within the zip: NumPy's heading and the data.
    """

    name: str
    dtype: str
    shape: tuple[int, ...]
    crc: int = 0
    sha256: str = ""

    @property
    def nbytes(self) -> int:
        """Size of the data."""
        return prod(self.shape) * np.dtype(self.dtype).itemsize

    @property
    def heading(self) -> bytes:
        """What stands before the data, version 1.0 of NumPy's format."""
        text = f"{{'descr': '{self.dtype}', 'fortran_order': False, 'shape': {self.shape!r}, }}"
        text += " " * (-(10 + len(text) + 1) % 64) + "\n"
        return b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text.encode("ascii")


def skeleton(members: Sequence[Member]) -> tuple[list[bytes], bytes]:
    """Return what stands before each member's data, and what stands behind the last.

    The first member is small: its size always has 32 bits.
    """
    total = sum(len(m.heading) + m.nbytes + len(m.name.encode()) + 200 for m in members)
    wide = total > NARROW
    heads, directory, at = [], b"", 0
    for k, member in enumerate(members):
        name, size = f"{member.name}.npy".encode(), len(member.heading) + member.nbytes
        long = wide and k > 0
        local, central = b"", b""
        if long:
            local = struct.pack("<HHQQ", 1, 16, size, size)
            central = struct.pack("<HHQQQ", 1, 24, size, size, at)
        told = _ALL if long else size
        version, flags = (45 if long else 20), (0 if name.isascii() else 0x800)
        common = struct.pack("<5H3IH", version, flags, 0, 0, _DATE, member.crc, told, told,
                             len(name))  # fmt: skip
        head = b"PK\x03\x04" + common + struct.pack("<H", len(local)) + name + local
        directory += struct.pack("<4sH", b"PK\x01\x02", version) + common
        directory += struct.pack("<4H2I", len(central), 0, 0, 0, 0, _ALL if long else at)
        directory += name + central
        heads.append(head + member.heading)
        at += len(head) + size
    return heads, directory + _end(len(members), len(directory), at, wide)


def _end(count: int, size: int, at: int, wide: bool) -> bytes:
    """Return the end of the zip: how many members, and where the directory is."""
    if not wide:
        return struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, count, count, size, at, 0)
    record = struct.pack("<4sQ2H2I4Q", b"PK\x06\x06", 44, 45, 45, 0, 0, count, count, size, at)
    locator = struct.pack("<4sIQI", b"PK\x06\x07", 0, at + size, 1)
    return (
        record
        + locator
        + struct.pack("<4s4H2IH", b"PK\x05\x06", 0, 0, 0xFFFF, 0xFFFF, _ALL, _ALL, 0)
    )
