"""Arrays of float64 in fewer bytes, every bit kept.

What a simulation records is smooth: a number is nearly what the few before it foretell. Written are
the differences of so many orders down each column, taken between the numbers' bits as integers
(which wrap, so that nothing is lost); small ones have leading bytes of zero, which stand together
once the bytes are sorted by their place, and deflate takes the rest.
"""

from __future__ import annotations

import zlib
from math import prod

import numpy as np
from numpy.typing import NDArray

from fpid_pin.checks import FloatArray

Bytes = NDArray[np.uint8]

#: Orders of difference that are tried; noise grows by each, so that no one order is the best.
ORDERS = range(8)
#: Rows, from the middle, by which the order is chosen.
_TRIED = 512
#: More zlib effort than this gains 1 or 2 % and takes twice as long.
_LEVEL = 1


def pack(array: FloatArray) -> Bytes:
    """Return an array, (N,) or (N, n), as bytes: the order of its differences, then deflate's."""
    columns = prod(array.shape[1:])
    numbers = np.ascontiguousarray(array, "<f8").reshape(len(array), columns).view(np.int64)
    middle = max(len(numbers) - _TRIED, 0) // 2
    tried = numbers[middle : middle + _TRIED]
    order = min(ORDERS, key=lambda k: len(_deflated(tried, k)))
    return np.frombuffer(bytes([order]) + _deflated(numbers, order), np.uint8)


def unpack(packed: Bytes, shape: tuple[int, ...]) -> FloatArray:
    """Return the array of `shape` that was packed; never more than that is taken from the bytes.

    Raises
    ------
    ValueError
        They are not what an array of this shape was packed into.
    """
    if packed.size < 1 or packed[0] not in ORDERS:
        raise ValueError("no order of difference")
    rows, columns = shape[0], prod(shape[1:])
    size = 8 * rows * columns
    inflate = zlib.decompressobj(-zlib.MAX_WBITS)
    try:
        # One byte more than expected, so that too many are noticed.
        planes = inflate.decompress(packed[1:].data, size + 1)
    except zlib.error as error:
        raise ValueError(f"what deflate cannot have written ({error})") from None
    if len(planes) != size or not inflate.eof or inflate.unused_data:
        raise ValueError("another number of bytes")
    numbers = np.empty((rows, columns), np.int64)
    places = np.frombuffer(planes, np.uint8).reshape(8, columns, rows)
    for j in range(columns):
        zigzag = np.ascontiguousarray(places[:, j].T).reshape(-1).view("<u8")
        numbers[:, j] = (zigzag >> 1) ^ -(zigzag & 1)
    for _ in range(packed[0]):
        np.cumsum(numbers, axis=0, out=numbers)
    return numbers.view(np.float64).reshape(shape)


def _deflated(numbers: NDArray[np.int64], order: int) -> bytes:
    rest = numbers.copy()
    for _ in range(order):
        rest[1:] -= rest[:-1].copy()
    # Small negative numbers have leading ones, unless the sign is put last.
    zigzag = np.ascontiguousarray(((rest << 1) ^ (rest >> 63)).T)
    planes = np.ascontiguousarray(zigzag.view(np.uint8).reshape(-1, 8).T)
    deflate = zlib.compressobj(_LEVEL, zlib.DEFLATED, -zlib.MAX_WBITS)
    return deflate.compress(planes.tobytes()) + deflate.flush()
