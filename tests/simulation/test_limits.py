"""Limits watched: the joint, the limit and the time of its first passing."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import GravityOnly
from fpid_pin.references import Hold
from fpid_pin.simulation import limit_report


def falling(arm, **others):
    experiment = fp.Experiment(arm=arm, reference=Hold(arm.home), duration=0.4, **others)
    return fp.simulate(experiment, GravityOnly())


def test_a_joint_that_drifts_passes_its_limits_when_kinematics_say():
    arm = fp.Arm.from_example("asr_twodof").with_limits(velocity=(1.5, 0.0))
    speed = np.array([2.0, 0.0])
    run = falling(arm, q0=(2.8, 0.0), v0=speed)
    found = limit_report(run)
    first, second = found[0], found[1]
    assert (first.quantity, first.joint, first.time) == ("velocity", arm.joint_names[0], 0.0)
    assert second.quantity == "position"
    assert second.limit == pytest.approx(3.14)
    passed = run.t[np.argmax(run.q[:, 0] > arm.upper[0])]
    assert second.time == passed
    assert second.value == pytest.approx(run.q[:, 0].max())
    assert second.part == pytest.approx(np.mean(run.q[:, 0] > arm.upper[0]))
    assert "position beyond 3.14 rad at" in str(second)


def test_lower_limits_count_too():
    arm = fp.Arm.from_example("z1")
    run = falling(arm, q0=arm.home + np.array([0, -0.5, 0, 0, 0, 0, 0]))
    first = limit_report(run)[0]
    assert (first.joint, first.limit, first.time) == ("joint2", 0.0, 0.0)
    assert first.value == pytest.approx(run.q[:, 1].min())


def test_an_arm_within_its_limits_has_nothing_to_report():
    assert limit_report(falling(fp.Arm.from_example("panda"))) == []


def test_torque_at_its_limit_is_listed_with_its_share():
    arm = fp.Arm.two_link().with_limits(effort=(20.0, 0.0))
    with pytest.warns(fp.FpidWarning, match="joint joint1: gravity at the start is 27"):
        run = falling(arm)
    (found,) = [item for item in limit_report(run) if item.quantity == "effort"]
    assert found.joint == "joint1"
    assert found.part == pytest.approx(np.mean(np.abs(run.torque[:, 0]) == 20.0))
    assert "at its effort limit of 20 N m" in str(found)


def test_a_drive_too_weak_for_the_start_pose_is_named():
    arm = fp.Arm.two_link().with_limits(effort=(20.0, 10.0))
    experiment = fp.Experiment(arm=arm, reference=Hold(0.0))
    (line,) = experiment.joints_that_fall()
    assert "joint1" in line
    assert "27.4 N m" in line
    assert "limit of 20 N m" in line
    upright = fp.Experiment(arm=arm, reference=Hold((np.pi / 2.0, 0.0)))
    assert upright.joints_that_fall() == []


def test_the_true_arm_is_the_one_that_is_weighed():
    arm = fp.Arm.two_link().with_limits(effort=(30.0, 10.0))
    loaded = fp.Plant(arm=arm.with_payload(0.5))
    assert fp.Experiment(arm=arm, reference=Hold(0.0)).joints_that_fall() == []
    lines = fp.Experiment(arm=arm, reference=Hold(0.0), plant=loaded).joints_that_fall()
    assert [line.split(":")[1] for line in lines] == [" joint joint1", " joint joint2"]
