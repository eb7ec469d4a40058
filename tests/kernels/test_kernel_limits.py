"""Clipping, anti-windup, and numbers that are none."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import clip, finite, saturate, winds_up

pytestmark = pytest.mark.kernels
numbers = st.floats(-1e6, 1e6)


@given(numbers, st.floats(0.0, 1e6))
def test_a_clipped_number_is_the_nearest_within(x, limit):
    assert clip(x, limit) == float(np.clip(x, -limit, limit))


def test_what_is_not_finite_stays_and_inf_is_no_limit():
    assert np.isnan(clip(np.nan, 1.0))
    assert clip(1e300, np.inf) == 1e300
    assert clip(-np.inf, 2.0) == -np.inf
    assert clip(np.inf, 2.0) == np.inf


@given(numbers, numbers)
def test_only_a_push_in_the_direction_of_the_cut_winds_up(cut, push):
    expected = np.sign(cut) * np.sign(push) > 0.0 and abs(cut * push) > 0.0
    assert winds_up(cut, push) == expected


def test_a_number_that_is_none_is_found_anywhere():
    for bad in (np.nan, np.inf, -np.inf):
        for at in range(3):
            values = np.array([1.0, 1e308, -1e308])
            assert finite(values)
            values[at] = bad
            assert not finite(values)


def test_what_is_cut_is_remembered():
    joints = np.zeros(3, layout("limit cut ticks"))
    joints["limit"] = 2.0
    torque = np.array([5.0, -3.0, 1.0])
    saturate(joints, torque)
    assert torque.tolist() == [2.0, -2.0, 1.0]
    assert joints["cut"].tolist() == [3.0, -1.0, 0.0]
    assert joints["ticks"].tolist() == [1.0, 1.0, 1.0]
