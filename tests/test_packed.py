"""Fewer bytes, and every bit of every number."""

import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays_of

from fpid_pin.packed import pack, unpack


def by_the_page(packed, shape):
    """Unpack as docs/data.md says, without the package."""
    order, planes = packed[0], zlib.decompress(packed[1:].tobytes(), -15)
    z = np.frombuffer(planes, np.uint8).reshape(8, -1).T.copy().view(np.uint64)
    x = ((z >> 1) ^ -(z & 1)).view(np.int64).reshape(-1, shape[0]).T.copy()
    for _ in range(order):
        x = np.cumsum(x, axis=0)
    return x.view(np.float64).reshape(shape)


@given(
    arrays_of.arrays(
        np.uint64,
        arrays_of.array_shapes(max_dims=2, max_side=30),
        elements=st.integers(0, 2**64 - 1),
    )
)
def test_any_bits_come_back_nan_s_and_zeros_signs_among_them(bits):
    array = bits.view(np.float64)
    assert unpack(pack(array), array.shape).tobytes() == array.tobytes()
    assert by_the_page(pack(array), array.shape).tobytes() == array.tobytes()


@pytest.mark.parametrize("shape", [(0,), (0, 3), (1,), (5000,), (5000, 3)])
def test_any_shape_comes_back(shape):
    array = np.random.default_rng(0).normal(size=shape)
    assert unpack(pack(array), shape).tobytes() == array.tobytes()


def test_smooth_numbers_take_a_quarter_and_noise_no_more_than_it_had():
    t = np.linspace(0.0, 20.0, 20_001)
    assert pack(np.sin(t)).nbytes < t.nbytes / 4
    noise = np.random.default_rng(0).normal(size=20_001)
    assert pack(noise).nbytes < 1.01 * noise.nbytes


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda p: p[:0], "no order"),
        (lambda p: np.append(np.uint8(9), p[1:]), "no order"),
        (lambda p: p[:-3], "another number of bytes"),
        (lambda p: np.append(p, np.uint8(0)), "another number of bytes"),
        (lambda p: pack(np.zeros(40)), "another number of bytes"),
        (lambda p: pack(np.zeros(50_000_000 // 8)), "another number of bytes"),
        (lambda p: np.full(20, 7, np.uint8), "what deflate cannot have written"),
    ],
)
def test_other_bytes_are_refused(change, message):
    with pytest.raises(ValueError, match=message):
        unpack(change(pack(np.sin(np.arange(41.0)))), (41,))
