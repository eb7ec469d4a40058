"""What sensors do to q and q': quantisation, noise, differentiation, delay."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.costs.cost import BLOCK_ROWS
from fpid_pin.kernels.rollout import measure
from fpid_pin.simulation.engine import SensorState

STEP = 1e-3


def measured(sensors, q, v=None, seed=0, block=1):
    """Pass signals (K, n) through the sensors of a robot, (K, 2, n), `block` ticks a call."""
    rows, n = q.shape
    state, v = SensorState(sensors, seed, n, STEP), np.zeros_like(q) if v is None else v
    inputs, found = np.zeros((5, n)), np.zeros((rows, 2, n))
    for first in range(0, rows, block):
        records = state.records(first, min(block, rows - first))
        for k in range(first, min(first + block, rows)):
            measure(*records, q[k], v[k], k, inputs)
            found[k] = inputs[:2]
    return found


def ramp(rows, slope=1.0):
    return slope * STEP * np.arange(rows)[:, np.newaxis]


def test_noise_has_its_standard_deviation_and_is_white():
    q = np.zeros((20_000, 2))
    sensors = fp.Sensors(position_noise=(1e-3, 0.0), velocity_noise=0.05)
    found = measured(sensors, q)
    assert found[:, 0, 0].std() == pytest.approx(1e-3, rel=0.03)
    assert (found[:, 0, 1] == 0.0).all()
    speed = found[:, 1]
    assert speed.std(axis=0) == pytest.approx([0.05, 0.05], rel=0.03)
    neighbours = np.corrcoef(speed[1:, 0], speed[:-1, 0])[0, 1]
    between = np.corrcoef(speed[:, 0], speed[:, 1])[0, 1]
    assert abs(neighbours) < 0.03
    assert abs(between) < 0.03


def test_angles_are_late_and_in_whole_steps_and_rates_have_a_bias():
    """Before t = 0 the arm was at rest where it starts."""
    q, v = ramp(50, slope=0.37) + 0.3, ramp(50, slope=-2.0)
    sensors = fp.Sensors(delay=7, position_resolution=1e-2, velocity_bias=0.02)
    found, late = measured(sensors, q, v), np.concatenate([q[:1].repeat(7, axis=0), q[:-7]])
    assert found[:, 0] == pytest.approx(1e-2 * np.rint(late / 1e-2), abs=1e-12)
    assert found[7:, 1] == pytest.approx(v[:-7] + 0.02)


def test_differentiation_finds_the_speed_of_a_ramp_with_the_filters_lag():
    cutoff = 50.0
    q = ramp(400, slope=2.0)
    found = measured(fp.Sensors(velocity="differentiated", velocity_cutoff=cutoff), q)[:, 1, 0]
    t = STEP * np.arange(400)
    assert found == pytest.approx(2.0 * (1.0 - np.exp(-cutoff * t)), abs=1e-9)


@pytest.mark.parametrize("velocity", ["measured", "differentiated"])
def test_noise_depends_on_the_seed_and_not_on_how_many_ticks_a_call_makes(velocity):
    sensors = fp.Sensors(
        position_noise=1e-3, velocity_noise=1e-2, delay=2, position_resolution=1e-4,
        velocity=velocity,
    )  # fmt: skip
    q = np.random.default_rng(1).uniform(-1, 1, (BLOCK_ROWS + 300, 2))
    one = measured(sensors, q, seed=3)
    for block in (256, BLOCK_ROWS):
        assert (measured(sensors, q, seed=3, block=block) == one).all()
    assert (measured(sensors, q, seed=4)[:, 0] != one[:, 0]).mean() > 0.9
