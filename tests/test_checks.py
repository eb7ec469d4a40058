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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        *[(lambda x=x: checks.floats("x", x), "x: expected numbers")
          for x in ("1", True, [[1.0], [1.0, 2.0]], 1j)],
        (lambda: checks.per_joint("kp", [1, 2, 3], 2), r"kp: expected shape \(2,\).*shape \(3,\)"),
        *[(lambda n=n: checks.integer("n", n), "n: expected a whole number") for n in (1.5, True)],
        *[(lambda clock=clock: checks.sample_count(*clock), "step|duration")
          for clock in ((1.0, 0.0), (1.0, -1.0), (1e-4, 1e-3), (0.0, 1.0))],
    ],
)  # fmt: skip
def test_other_than_asked_for_is_refused(call, message):
    with pytest.raises(ArgumentError, match=message):
        call()


def test_scalars_are_broadcast_over_the_joints():
    assert (checks.per_joint("kp", 2, 3) == [2.0, 2.0, 2.0]).all()


def test_both_ends_of_a_run_are_rows():
    for duration, step, rows in ((20.0, 1e-3, 20001), (1e-3, 1e-3, 2), (0.3, 0.1, 4)):
        assert checks.sample_count(duration, step) == rows
