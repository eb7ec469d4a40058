"""Rates from angles: late by what is said, noisy by what is said."""

import numpy as np
import pytest

from fpid_pin.control import EncoderRate

STEP = 1e-3


@pytest.mark.parametrize("tau", [0.0, 0.002, 0.02])
def test_it_is_late_by_its_delay(tau):
    """Of q = t^2/2 the rate is t, and the filter's t - delay once its start has died away."""
    rate = EncoderRate(tau).start(STEP)
    t = STEP * np.arange(2000)
    for now in t:
        found = rate.rate(np.array([0.5 * now**2, -0.5 * now**2]))
    late = t[-1] - found[0]
    assert late == pytest.approx(EncoderRate(tau).delay(STEP), rel=1e-9)
    assert found[1] == pytest.approx(-found[0])


@pytest.mark.parametrize("tau", [0.0, 0.005])
def test_its_noise_is_that_of_rounded_angles(tau):
    resolution, filter_ = 2 * np.pi / 4096, EncoderRate(tau)
    joints = 500  # moving by some thirty steps of the encoder a tick, none of them alike
    speeds = np.linspace(40.0, 60.0, joints) * resolution / (2 * STEP)
    rate, found = filter_.start(STEP), []
    for k in range(400):
        angle = speeds * k * STEP + np.linspace(0.0, 1.0, joints)
        found.append(rate.rate(resolution * np.round(angle / resolution)) - speeds)
    spread = np.std(found[100:])
    assert spread == pytest.approx(filter_.noise(resolution, STEP), rel=0.05)


def test_a_steady_motion_is_the_same_through_ticks_that_were_missed():
    rate, through = EncoderRate(0.004).start(STEP), EncoderRate(0.004).start(STEP)
    q = 0.3 * STEP * np.arange(20.0)
    for value in q:
        every = rate.rate(np.array([value]))
    for k in (0, 1, 5, 6, 19):
        some = through.rate(q[k : k + 1], {0: 1, 1: 1, 5: 4, 6: 1, 19: 13}[k])
    assert some == pytest.approx(every, rel=1e-12)


def test_a_turn_that_begins_again_is_no_jump():
    plain, wrapped = EncoderRate(0.0).start(STEP), EncoderRate(0.0, turn=2 * np.pi).start(STEP)
    for q in np.linspace(-20.0, 20.0, 400):
        expected = plain.rate(np.array([q, -q]))
        found = wrapped.rate(np.array([q, -q]) % (2 * np.pi))
    assert found == pytest.approx(expected, rel=1e-9)


def test_joints_may_have_different_turns_or_none():
    encoder = EncoderRate(0.0, turn=[2 * np.pi, np.inf, 0.1])
    angle, to = np.array([0.1, 0.1, 0.02]), np.array([12.5, 12.5, 12.5])
    assert encoder.nearest(angle, to) == pytest.approx([0.1 + 4 * np.pi, 0.1, 12.52], abs=1e-12)
    assert EncoderRate().nearest(angle, to).tolist() == angle.tolist()


def test_it_starts_at_rest_and_again_after_a_reset():
    rate = EncoderRate().start(STEP)
    assert (rate.rate(np.array([3.0])) == 0.0).all()
    assert rate.rate(np.array([3.1])) > 0.0
    rate.reset()
    assert (rate.rate(np.array([9.0])) == 0.0).all()
