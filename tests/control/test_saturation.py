"""Effort limits and anti-windup: states are held, and only where integrating on would wind up."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.references import Hold


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


def test_held_integrals_overshoot_less_than_wound_up_ones():
    arm = fp.Arm.planar([1.0], [1.0], gravity=0.0).with_limits(effort=1.0)
    law = fp.AdaptiveFpid(
        kp=30.0, ki=30.0, kd=10.0, integral_order=0.9, derivative_order=0.95, learning_rate=1.0
    )
    experiment = fp.Experiment(arm=arm, reference=Hold(1.0), q0=0.0, duration=5.0, step=2e-3)
    held = fp.simulate(experiment, law)
    # A law that does not know of the drive's limit winds up.
    ignorant = dataclasses.replace(
        experiment, arm=arm.with_limits(effort=np.inf), plant=fp.Plant(effort_limit=1.0)
    )
    wound = fp.simulate(ignorant, law)
    assert -held.error.min() < 0.8 * -wound.error.min()
    assert held.metrics.rms_tail[0] < wound.metrics.rms_tail[0]
