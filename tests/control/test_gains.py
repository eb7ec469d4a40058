"""Suggested gains work on arms that nobody has tuned, and ceilings are where the loop breaks."""

import dataclasses
import warnings

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.control import Controller
from fpid_pin.control.ceilings import gain_ceilings
from fpid_pin.control.gains import impossible_joints, suggest_gains
from fpid_pin.control.sampled import critical_derivative
from fpid_pin.control.suggested import SuggestedFpid
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional import Crone, ExponentialSum
from fpid_pin.references import Hold, Sinusoid


def around_home(arm, **others):
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    reference = Sinusoid(amplitude=0.3, frequency=1.0, phase=phase, offset=arm.home)
    return fp.Experiment(arm=arm, reference=reference, **others)


@pytest.mark.parametrize("name", ["asr_twodof", "kinova", "xarm7"])
def test_suggested_gains_follow_a_sinusoid_without_tuning(name):
    arm = fp.Arm.from_example(name)
    law = suggest_gains(arm, step=2e-3)
    run = fp.simulate(around_home(arm, duration=6.0, step=2e-3), law)
    assert run.outcome.completed
    assert (run.metrics.rms_tail < 0.05).all()
    highest = np.asarray(law.safeguards.maximum)
    for gains, most in zip((run.kp, run.ki, run.kd), highest, strict=True):
        assert (gains <= most).all()


@pytest.mark.parametrize(
    ("name", "mu"), [("two_link", 1.0), ("two_link", 0.8), ("panda", 0.95), ("ur10", 1.0)]
)
def test_the_loop_breaks_where_the_sampled_bound_says(name, mu):
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    # No gravity, no friction, one pose: the derivative term alone, raised until it breaks.
    arm = arm.with_gravity(0.0).with_friction(viscous=0.0).with_limits(effort=0.0)
    law = fp.AdaptiveFpid(
        kp=0.0, ki=0.0, kd=1.0, derivative_order=mu, learning_rate=0.0, scale="inertia"
    )
    limit = gain_ceilings(arm, law, poses=1).kd_limit[0]
    parts = np.array([0.9, 0.97, 1.03, 1.1])
    start = np.full(arm.n, 1e-7)
    experiment = fp.Experiment(
        arm=arm, reference=Hold(arm.home), q0=arm.home, v0=start, duration=0.5
    )
    runs = fp.simulate(experiment, [dataclasses.replace(law, kd=limit * x) for x in parts])
    # A loop that has broken throws the arm about until it finds a pose that it can bear.
    peaks = [np.abs(run.v).max() for run in runs]
    assert max(peaks[:2]) < 1e-5
    assert min(peaks[2:]) > 1e-3


def test_the_worst_pose_is_among_those_looked_at_and_more_poses_bind_more():
    arm = fp.Arm.from_example("panda")
    law = suggest_gains(arm)
    few, many = (gain_ceilings(arm, law, poses=k) for k in (1, 200))
    assert few.pose == pytest.approx(arm.home)
    assert (many.kd < few.kd).all()
    assert (many.pose >= arm.lower).all()
    assert (many.pose <= arm.upper).all()
    assert many.kd == pytest.approx(0.5 * many.kd_limit)
    assert (law.kd <= many.kd * (1.0 + 1e-9)).all()


def test_an_integer_derivative_bears_two_over_the_step():
    for step in (1e-3, 2e-3):
        found = critical_derivative(ExponentialSum(modes=24), 1.0, step=step, horizon=20.0)
        assert found == pytest.approx(2.0 / step, rel=1e-12)


def test_a_lower_order_bears_more_in_its_own_units():
    design = ExponentialSum(modes=24)
    found = [critical_derivative(design, mu, step=1e-3, horizon=20.0) for mu in (1.0, 0.9, 0.7)]
    assert found == sorted(found)
    crone = Crone(low=1e-2, high=1e3, n=5)
    assert critical_derivative(crone, 0.9, step=1e-3, horizon=20.0) > 2000.0


def test_bandwidth_sets_the_speed():
    arm = fp.Arm.two_link()
    slow, fast = (suggest_gains(arm, w) for w in (5.0, 20.0))
    assert np.asarray(fast.kp) == pytest.approx(16.0 * np.asarray(slow.kp))
    assert (np.asarray(fast.kd) > np.asarray(slow.kd)).all()


def test_friction_counts_in_the_scale_and_the_effort_limit_bounds_it():
    arm = fp.Arm.two_link()
    rough = arm.with_friction(viscous=1.0, dry=1.0)
    added = np.asarray(suggest_gains(rough).scale) - np.asarray(suggest_gains(arm).scale)
    assert added == pytest.approx(np.full(2, 1.0 / 10.0 + 1.0 / (0.09 * 100.0)))
    weak = arm.with_gravity(0.0).with_limits(effort=2.0)
    assert (np.asarray(suggest_gains(weak).scale) * 100.0 * 0.05 <= 2.0 + 1e-12).all()


def test_fixed_gains_do_not_adapt():
    law = suggest_gains(fp.Arm.two_link(), adaptive=False)
    assert not np.any(law.learning_rate)
    assert law.safeguards is None


@pytest.mark.parametrize(
    ("name", "joint", "why"),
    [("bravo7_no_ee", "joint2", "gravity at home"), ("talos_arm", "gripper_left_joint", "dry")],
)
def test_joints_that_no_gains_can_move_are_named(name, joint, why):
    arm = fp.Arm.from_example(name)
    (line,) = impossible_joints(arm)
    assert joint in line
    assert why in line
    with pytest.warns(fp.FpidWarning, match=joint):
        suggest_gains(arm)


def test_no_warning_where_there_is_nothing_to_warn_of():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        suggest_gains(fp.Arm.from_example("ur5"))


def test_a_configuration_can_ask_for_suggested_gains():
    law = descriptions.from_dict({"kind": "suggested_fpid", "bandwidth": 12.0}, Controller)
    assert isinstance(law, SuggestedFpid)
    arm = fp.Arm.two_link()
    experiment = fp.Experiment(arm=arm, reference=Sinusoid(0.3), duration=0.1)
    one, other = fp.simulate(experiment, law), fp.simulate(experiment, law.on(arm))
    assert (one.torque == other.torque).all()


@pytest.mark.parametrize(
    ("build", "message"),
    [
        (lambda: suggest_gains(fp.Arm.two_link(), 0.0), "bandwidth: expected a number > 0"),
        (lambda: SuggestedFpid(bandwidth=-1.0), "bandwidth"),
        (lambda: SuggestedFpid(integral_order=1.2), r"integral_order: expected a number in \[0, 1"),
        (lambda: gain_ceilings(fp.Arm.two_link(), fp.ComputedTorque()), "expected an AdaptiveFpid"),
    ],
)
def test_bad_arguments_to_gains_are_named(build, message):
    with pytest.raises(ArgumentError, match=message):
        build()
