"""Measurements of one tick after another against NumPy's own rules."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fpid_pin.kernels import sensors

pytestmark = pytest.mark.kernels


@given(st.one_of(st.floats(-1e9, 1e9), st.integers(-1000, 1000).map(lambda k: k + 0.5)))
def test_numbers_are_rounded_as_numpy_does(x):
    assert sensors.rounded(x) == np.rint(x)


def test_delay_noise_bias_steps_and_filter_come_in_this_order():
    joints = np.zeros((3, 1), sensors.SENSOR)
    joints["delay"] = [[2], [0], [1]]
    joints["noise_q"], joints["noise_v"], joints["bias"] = 0.1, 0.2, 0.3
    joints["resolution"] = [[0.0], [0.25], [0.0]]
    joints["derived"] = [[0], [1], [0]]
    joints["keep"], joints["gain"] = 0.5, 50.0
    alive = np.array([True, True, False])
    history, noise = np.zeros((3, 2, 3, 1)), np.random.default_rng(0).normal(size=(8, 2, 3, 1))
    seen, kept, last = np.zeros((5, 3, 1)), 0.0, None
    q, v = np.random.default_rng(1).normal(size=(2, 6, 3, 1))
    for tick in range(6):
        x = np.stack([q[tick], v[tick]])
        sensors.measure(alive, joints, x, tick, history, noise, tick, seen)
        late = max(tick - 2, 0)
        assert seen[0, 0, 0] == pytest.approx(q[late, 0, 0] + 0.1 * noise[tick, 0, 0, 0])
        assert seen[1, 0, 0] == pytest.approx(v[late, 0, 0] + 0.2 * noise[tick, 1, 0, 0] + 0.3)
        angle = np.rint((q[tick, 1, 0] + 0.1 * noise[tick, 0, 1, 0]) / 0.25) * 0.25
        kept = 0.5 * kept + 50.0 * (angle - (angle if last is None else last))
        last = angle
        assert seen[0, 1, 0] == pytest.approx(angle)
        assert seen[1, 1, 0] == pytest.approx(kept)
        assert (seen[:2, 2] == 0.0).all()


def test_perfect_sensors_tell_the_truth():
    joints = np.zeros((1, 2), sensors.SENSOR)
    q, v = np.random.default_rng(2).normal(size=(2, 1, 2))
    seen = np.zeros((5, 1, 2))
    sensors.measure(np.ones(1, bool), joints, np.stack([q, v]), 0, np.zeros((1, 2, 1, 2)),
                    np.zeros((0, 2, 1, 2)), 0, seen)  # fmt: skip
    assert (seen[0] == q).all()
    assert (seen[1] == v).all()
