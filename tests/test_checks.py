"""Shapes and ranges are refused in one clear line."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError


@given(hnp.arrays(np.float64, hnp.array_shapes(max_dims=2), elements=st.floats(-1e6, 1e6)))
def test_floats_gives_an_equal_copy_that_cannot_be_written(array):
    result = checks.floats("x", array)
    assert (result == array).all()
    assert not result.flags.writeable
    assert not np.shares_memory(result, array)


@given(
    hnp.arrays(np.float64, 5, elements=st.floats(0, 1)),
    st.integers(0, 4),
    st.sampled_from([np.nan, np.inf, -np.inf, -0.5, 1.5]),
)
def test_the_element_at_fault_is_named(array, index, bad):
    array[index] = bad
    with pytest.raises(ArgumentError) as caught:
        checks.floats("kp", array, low=0.0, high=1.0)
    assert caught.value.name == f"kp.{index}"
    assert f"{bad:g}" in str(caught.value)


@pytest.mark.parametrize("value", ["1", True, [[1.0], [1.0, 2.0]], 1j])
def test_what_is_not_a_number_is_refused(value):
    with pytest.raises(ArgumentError, match="x: expected numbers"):
        checks.floats("x", value)


def test_scalars_are_broadcast_over_the_joints_and_lengths_checked():
    assert (checks.per_joint("kp", 2, 3) == [2.0, 2.0, 2.0]).all()
    with pytest.raises(ArgumentError, match=r"kp: expected shape \(2,\).*got shape \(3,\)"):
        checks.per_joint("kp", [1, 2, 3], 2)


@pytest.mark.parametrize("value", [1.5, True])
def test_whole_numbers_are_whole(value):
    with pytest.raises(ArgumentError, match="n: expected a whole number"):
        checks.integer("n", value)


@pytest.mark.parametrize(
    ("duration", "step", "rows"), [(20.0, 1e-3, 20001), (1e-3, 1e-3, 2), (0.3, 0.1, 4)]
)
def test_both_ends_of_a_run_are_rows(duration, step, rows):
    assert checks.sample_count(duration, step) == rows


@pytest.mark.parametrize(("duration", "step"), [(1.0, 0.0), (1.0, -1.0), (1e-4, 1e-3), (0.0, 1.0)])
def test_impossible_clocks_are_refused(duration, step):
    with pytest.raises(ArgumentError, match="step|duration"):
        checks.sample_count(duration, step)
