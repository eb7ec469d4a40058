"""Effort limits and anti-windup: states are held, and only where integrating on would wind up."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import fpid_pin as fp
from fpid_pin.control.saturation import Saturation
from fpid_pin.references import Hold

numbers = st.floats(-100.0, 100.0, allow_nan=False)


@given(arrays(np.float64, (3, 2), elements=numbers), arrays(np.float64, (3, 2), elements=numbers))
def test_torques_are_clipped_and_only_further_pushes_wind_up(torque, push):
    limit = np.array([10.0, np.inf])
    asked = torque.copy()
    component = Saturation(limit, 3)
    given_ = component.apply(torque)
    assert given_ is torque
    assert (torque == np.clip(asked, -limit, limit)).all()
    mask = component.winds_up(push)
    further = (np.abs(asked) > limit) & (np.sign(asked) == np.sign(push))
    tiny = np.abs(push) < 1e-200  # the product of cut and push underflows
    assert ((np.zeros((3, 2), bool) if mask is None else mask) == further)[~tiny].all()


def test_without_limits_nothing_winds_up():
    component = Saturation(np.full(2, np.inf), 1)
    component.apply(np.full((1, 2), 1e9))
    assert component.winds_up(np.ones((1, 2))) is None


def saturated(law, ticks):
    """Ask for far more than the limit, and return the signals before and after."""
    loop = law.start(fp.Arm.planar([1.0], [1.0]).with_limits(effort=1.0), step=1e-3)
    loop.torque([0.0], [0.0], [1.0], [0.0])
    before = loop.signals()
    for _ in range(ticks):
        torque = loop.torque([0.0], [0.0], [1.0], [0.0])
    return loop, torque, before


LAW = fp.AdaptiveFpid(kp=10.0, ki=20.0, kd=1.0, integral_order=0.8, derivative_order=0.9)


def test_adaptation_and_both_integrals_hold_while_the_torque_is_cut():
    loop, torque, before = saturated(LAW, 200)
    after = loop.signals()
    assert torque == pytest.approx([1.0])
    for name in ("kp", "ki", "kd"):
        assert (after[name] == before[name]).all()
    # S = -(e' + k1 e + k0 int e) with e = 1: int e has not moved.
    assert after["s"] == pytest.approx([-2.0], abs=1e-2)
    # Nor has the fractional integral, which is also not fading as it would on a zero error.
    assert after["u_fpid"] == pytest.approx([10.0], abs=0.5)


def test_a_push_back_from_the_limit_unwinds_at_once():
    loop, _, _ = saturated(dataclasses.replace(LAW, kd=0.0), 50)
    gains = loop.signals()["ki"]
    surface = loop.signals()["s"]
    for _ in range(3):
        loop.torque([2.0], [0.0], [1.0], [0.0])
    # e is now -1: the torque has left the upper limit, and S follows int e down again.
    for _ in range(3):
        torque = loop.torque([0.99], [0.0], [1.0], [0.0])
    assert abs(torque[0]) < 1.0
    assert (loop.signals()["s"] != surface).all()
    assert (loop.signals()["ki"] != gains).any()


def test_held_integrals_overshoot_less_than_wound_up_ones(monkeypatch):
    arm = fp.Arm.planar([1.0], [1.0], gravity=0.0).with_limits(effort=1.0)
    law = fp.AdaptiveFpid(
        kp=30.0, ki=30.0, kd=10.0, integral_order=0.9, derivative_order=0.95, learning_rate=1.0
    )
    experiment = fp.Experiment(arm=arm, reference=Hold(1.0), q0=0.0, duration=5.0, step=2e-3)
    held = fp.simulate(experiment, law)
    monkeypatch.setattr(Saturation, "winds_up", lambda self, push: None)
    wound = fp.simulate(experiment, law)
    assert -held.error.min() < 0.8 * -wound.error.min()
    assert held.metrics.rms_tail[0] < wound.metrics.rms_tail[0]
