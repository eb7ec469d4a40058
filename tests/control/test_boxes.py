"""The suggested box is stable where gains are let go, judged by loops that are written out here."""

import dataclasses
import itertools
import logging

import numpy as np
import pinocchio as pin
import pytest

import fpid_pin as fp
from fpid_pin.control import Safeguards, explain_gains, gain_ceilings, suggest_gains


def arm_named(name):
    return fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)


def grows(arm, law, gains, q, step, duration):
    """Kick the arm, linearised at rest at q, under a law whose gains stand still."""
    model, n = arm.model.copy(), arm.n
    data = model.createData()
    upper = np.triu(pin.crba(model, data, q))
    inertia = upper + np.triu(upper, 1).T
    stiffness = pin.computeGeneralizedGravityDerivatives(model, data, q)
    implicit = np.linalg.inv(inertia + step * np.diag(arm.viscous_friction))
    fixed = dataclasses.replace(
        law, kp=gains[0], ki=gains[1], kd=gains[2], learning_rate=0.0, safeguards=None
    )
    loop = fixed.start(arm.with_limits(effort=0.0), step=step)
    still, x = np.zeros(n), np.zeros(n)
    v = np.random.default_rng(0).normal(size=n)
    moved = []
    for _ in range(round(duration / step)):
        tau = loop.torque(q + x, v, q, still, still)
        v = v + step * implicit @ (tau - stiffness @ x - arm.viscous_friction * v)
        x = x + step * v
        moved.append(np.abs(x).max())
        if moved[-1] > 1e6:
            return True
    half = len(moved) // 2
    return max(moved[half:]) > 0.9 * max(moved[:half])


def some_gains(low, high, count, rng):
    """Yield all corners at which joints are alike, random corners, and random gains inside."""
    for corner in itertools.product((0.0, 1.0), repeat=3):
        yield low + np.array(corner)[:, np.newaxis] * (high - low)
    for k in range(count):
        part = rng.random(low.shape)
        yield low + (part if k % 2 else np.round(part)) * (high - low)


@pytest.mark.parametrize(
    ("name", "step"),
    [("two_link", 1e-3), ("ur5", 4e-3), ("kinova", 2e-3), ("z1", 4e-3), ("finger_edu", 4e-3)],
)
def test_no_gains_of_the_suggested_box_are_unstable_where_they_stand_still(name, step):
    arm, rng = arm_named(name), np.random.default_rng(3)
    law = suggest_gains(arm, step=step)
    low, high = Safeguards.bounds_of(law.safeguards, arm.n)
    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    lightest = gain_ceilings(arm, law, step=step, seed=5).pose
    for k, gains in enumerate(some_gains(low, high, 12, rng)):
        q = (lightest, arm.home, rng.uniform(lower, upper))[k % 3]
        assert not grows(arm, law, gains, q, step, 6.0), (k, gains)


def test_the_check_itself_finds_what_is_unstable():
    arm, step = fp.Arm.from_example("ur5"), 4e-3
    law = suggest_gains(arm, step=step)
    low, high = Safeguards.bounds_of(law.safeguards, arm.n)
    windup = np.stack([low[0], 8.0 * high[1], low[2]])
    stiff = np.stack([low[0], low[1], 1.1 * gain_ceilings(arm, law, step=step).kd_limit])
    pose = gain_ceilings(arm, law, step=step).pose
    assert grows(arm, law, windup, arm.home, step, 6.0)
    assert grows(arm, law, stiff, pose, step, 6.0)


def zeros_within(arm, law, ratio, largest):
    """Count zeros of det(M s^2 + F s + G' + s (Kp + Ki s^-lambda + Kd s^mu)) by their argument.

    In continuous time and without modes, in the sector of damping ratios below `ratio`.
    """
    q, n = arm.home, arm.n
    stiffness = pin.computeGeneralizedGravityDerivatives(arm.model, arm.model.createData(), q)
    turn = np.pi - np.arccos(ratio)
    radius = np.geomspace(0.05, largest, 4000)
    angle = np.linspace(-turn, turn, 2000)
    path = np.concatenate([
        largest * np.exp(1j * angle), radius[::-1] * np.exp(1j * turn),
        0.05 * np.exp(1j * angle[::-1]), radius * np.exp(-1j * turn),
    ])  # fmt: skip
    lam, mu = float(np.mean(law.integral_order)), float(np.mean(law.derivative_order))
    weighed = [law.scale_on(arm) * np.asarray(k) for k in (law.kp, law.ki, law.kd)]
    s = path[:, np.newaxis]
    own = arm.viscous_friction * s + weighed[0] + weighed[1] * s**-lam + weighed[2] * s**mu
    whole = arm.mass_matrix(q) * s[:, :, np.newaxis] ** 2 + stiffness
    signs, _ = np.linalg.slogdet(whole + own[:, :, np.newaxis] * np.eye(n))
    return round(np.ptp(np.unwrap(np.angle(signs))[[0, -1]]) / (2.0 * np.pi))


@pytest.mark.parametrize(
    ("name", "bandwidth"), [("two_link", 10.0), ("ur5", 10.0), ("panda", 10.0), ("ur10", 20.0)]
)
def test_the_damping_ratio_at_home_is_that_of_the_fractional_loop(name, bandwidth):
    arm = arm_named(name)
    found = explain_gains(arm, bandwidth, adaptive=False)
    low, high = 0.0, 1.0
    for _ in range(12):
        middle = 0.5 * (low + high)
        empty = zeros_within(arm, found.controller, middle, 0.25 * np.pi / 1e-3) == 0
        low, high = (middle, high) if empty else (low, middle)
    # Six modes and a step of 1 ms on the one side, neither on the other.
    assert found.damping_ratio == pytest.approx(low, abs=0.05)
    assert found.damping_ratio >= found.least_damping_ratio
    assert found.damping_ratio > 0.38


@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_a_joint_that_friction_stops_within_a_step_bears_half_of_two_over_the_step(step):
    arm = fp.Arm.planar(lengths=(0.3,), masses=(0.1,), gravity=0.0).with_friction(viscous=1e3)
    law = fp.AdaptiveFpid(
        kp=0.0, ki=0.0, kd=1.0, derivative_order=1.0, learning_rate=0.0, scale="inertia"
    )
    inertia = arm.mass_matrix(arm.home)[0, 0]
    limit = gain_ceilings(arm, law, step=step).kd_limit[0] * inertia  # N m s/rad
    assert limit == pytest.approx(2.0 * inertia / step + 1e3, rel=1e-9)
    assert limit < 1.02 * (inertia + step * 1e3) / step
    # q'+ = q' - h (Kd + F_v) q'/(M + h F_v)
    factors = [
        1.0 - step * (part * limit + 1e3) / (inertia + step * 1e3) for part in (0.999, 1.001)
    ]
    assert factors[1] < -1.0 < factors[0]
    rough = fp.Experiment(arm, fp.references.Hold(0.0), v0=1e-6, step=step, duration=400 * step)
    for part, most in ((0.95, 1.0), (1.05, np.inf)):
        run = fp.simulate(rough, dataclasses.replace(law, kd=part * limit / inertia))
        assert (np.abs(run.v[-1, 0]) < 1e-6) == (most == 1.0)


def test_the_worst_pose_is_as_bad_as_any_of_many_drawn():
    arm, step = fp.Arm.from_example("kinova"), 1e-3
    law, rng = suggest_gains(arm), np.random.default_rng(8)
    found = gain_ceilings(arm, law)
    kd = np.asarray(law.kd) * law.scale_on(arm)

    def load(q):
        felt = np.linalg.inv(arm.mass_matrix(q) + 0.5 * step * np.diag(arm.viscous_friction))
        return np.abs(np.linalg.eigvals(felt @ np.diag(kd))).max()

    lower, upper = np.maximum(arm.lower, -np.pi), np.minimum(arm.upper, np.pi)
    drawn = [load(rng.uniform(lower, upper)) for _ in range(200)]
    # Nearly singular, which samples miss; by how much depends on the last bits of a search.
    assert load(found.pose) >= max(drawn)


def test_what_is_lowered_is_said_and_logged(caplog):
    arm = fp.Arm.from_example("kinova")
    found = explain_gains(arm, step=2e-3)
    law = found.controller
    kp = np.asarray(law.kp)
    text = str(found)
    assert "derivative order 0.6 instead of 0.95: at a step of 2 ms" in text
    for joint, k in zip(arm.joint_names, kp, strict=True):
        assert (f"joint {joint}: Kp at" in text) == (k < 0.99 * 100.0)
    assert kp.min() < 99.0 < kp.max() + 1e-9
    assert found.bandwidth == pytest.approx(np.sqrt(kp))
    with caplog.at_level(logging.INFO, logger="fpid_pin"):
        suggest_gains(arm, step=2e-3)
    assert [record.getMessage() for record in caplog.records] == [
        f"kinova: {note}" for note in found.notes
    ]
    assert explain_gains(fp.Arm.two_link()).notes == ()


def test_a_given_order_is_kept():
    law = suggest_gains(fp.Arm.from_example("kinova"), derivative_order=0.95, adaptive=False)
    assert float(law.derivative_order) == 0.95


def test_a_search_that_gets_stuck_begins_again_at_less_bandwidth():
    # From the full bandwidth it ends at gains that are unstable.
    found = explain_gains(
        fp.Arm.from_example("finger_edu"), step=4e-3, derivative_order=0.95, adaptive=False
    )
    assert found.least_damping_ratio > 0.05
    assert found.damping_ratio > 0.25


def test_an_arm_for_which_no_stable_gains_are_found_is_warned_of():
    arm = fp.Arm.from_example("kinova")
    with pytest.warns(fp.FpidWarning, match="at a step of 20 ms no gains are found"):
        suggest_gains(arm, step=2e-2, adaptive=False)
