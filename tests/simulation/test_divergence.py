"""What no run can be meant to be is asked of or refused, what diverges ends with a cause."""

import dataclasses
import warnings

import numpy as np
import pytest
from robots import joint, link, robot

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.control import GravityOnly
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold
from fpid_pin.simulation import limit_report

EXPERIMENT = fp.paper_experiment(duration=2.0)
GOOD = fp.paper_controller()
BAD = dataclasses.replace(GOOD, kd=5000.0)


def test_a_runaway_names_time_joint_and_cause():
    run = fp.simulate(EXPERIMENT, BAD)
    assert not run.outcome.completed
    assert run.outcome.joint in EXPERIMENT.arm.joint_names
    assert "rad/s" in run.outcome.cause or "finite" in run.outcome.cause
    assert len(run.t) == round(run.outcome.time / 1e-3)
    assert np.abs(run.v).max() <= EXPERIMENT.runaway_speed
    assert np.isfinite(run.q).all()
    assert np.isfinite(run.torque).all()


class Overflowing(fp.Controller):
    """A law of one's own whose torque overflows."""

    @staticmethod
    def torque(c):
        return 1e308 * c.e * 10.0


class OverflowingInPython(fp.Controller):
    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return 1e308 * (q_ref - q) * 10.0


@pytest.mark.filterwarnings("ignore:overflow encountered")
@pytest.mark.parametrize(
    "law",
    [fp.AdaptiveFpid(1e308, 0, 0), dataclasses.replace(GOOD, kp=1e308), fp.Pid(1e308, 0, 0),
     Overflowing(), OverflowingInPython()],
)  # fmt: skip
@pytest.mark.parametrize("where", ["nominal limit", "plant's limit"])
@pytest.mark.parametrize("dynamics", ["pinocchio", "compiled"])
def test_an_overflow_behind_an_effort_limit_is_a_cause_and_not_a_run(law, where, dynamics):
    arm = fp.Arm.two_link()
    limited = arm.with_limits(effort=(50.0, 50.0))
    plant = fp.Plant(effort_limit=50.0)
    experiment = fp.Experiment(
        limited if where == "nominal limit" else arm, Hold(0.0), q0=(3.0, -3.0),
        plant=None if where == "nominal limit" else plant, duration=0.1, dynamics=dynamics,
    )  # fmt: skip
    run = fp.simulate(experiment, law)
    assert str(run.outcome) == "diverged at 0 s, joint1: torque is not finite"
    assert fp.evaluate(experiment, law) == np.inf


class Broken:
    """A disturbance that turns into NaN."""

    def sample(self, t):
        d = np.zeros((len(t), 2))
        d[t > 0.3] = np.nan
        return d


def test_nan_from_outside_ends_the_run_where_it_came_in():
    plant = fp.Plant(disturbance=Broken())
    run = fp.simulate(dataclasses.replace(EXPERIMENT, plant=plant), GOOD)
    assert run.outcome.cause == "speed is not finite"
    assert run.outcome.time == pytest.approx(0.302, abs=1e-9)


class BrokenReference:
    def sample(self, t):
        return (np.full((len(t), 2), np.nan),) * 3


def test_a_reference_that_is_not_finite_is_refused_before_anything_runs():
    with pytest.raises(ArgumentError, match=r"reference q: .* NaN or inf at t = 0 s"):
        fp.Experiment(fp.Arm.two_link(), BrokenReference())


def test_a_diverged_run_costs_infinity_and_its_metrics_are_those_of_its_rows():
    costs = fp.evaluate(EXPERIMENT, [GOOD, BAD])
    assert costs.tolist() == [*fp.evaluate(EXPERIMENT, GOOD), np.inf]
    run = fp.simulate(EXPERIMENT, BAD)
    e = run.error
    assert np.allclose(run.metrics.ise, 1e-3 * (e**2).sum(axis=0), rtol=1e-12)
    assert np.isnan(run.metrics.rms_tail).all()


class Ending(fp.Controller):
    """Holds the arm still, and has no torque for it at its eleventh tick."""

    def control(self, state, q, *others):
        k = state.memory["k"] = state.memory.get("k", 0) + 1
        return state.arm.gravity_vector(q) * (1.0 if k < 11 else np.nan)


@pytest.mark.parametrize("every", [1, 2, 5])
def test_a_run_that_ends_at_its_last_row_has_not_settled(every):
    still = fp.Experiment(fp.Arm.two_link(), Hold(0.0), duration=0.01)
    run = fp.simulate(still, Ending())
    assert len(run.t) == 10 < run.planned_rows
    assert (run.thinned(every).metrics.settling_time == np.inf).all()


def test_a_start_beyond_the_runaway_speed_is_refused():
    with pytest.raises(ArgumentError, match="v0: expected at most runaway_speed"):
        dataclasses.replace(EXPERIMENT, v0=(2000.0, 0.0))


# ---------------------------------------------------------------------- limits


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
    assert "beyond its upper position limit of 3.14 rad at" in str(second)


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


def test_a_drive_too_weak_for_the_true_arm_at_the_start_pose_is_named():
    arm = fp.Arm.two_link().with_limits(effort=(20.0, 10.0))
    (line,) = fp.Experiment(arm, Hold(0.0)).joints_that_fall()
    assert line.endswith(
        "joint joint1: gravity at the start is 27.4 N m, beyond its effort limit of 20 N m"
    )
    assert fp.Experiment(arm, Hold((np.pi / 2.0, 0.0))).joints_that_fall() == []
    strong = arm.with_limits(effort=(30.0, 10.0))
    assert fp.Experiment(strong, Hold(0.0)).joints_that_fall() == []
    loaded = fp.Plant(arm=strong.with_payload(0.5))
    lines = fp.Experiment(strong, Hold(0.0), plant=loaded).joints_that_fall()
    assert [line.split(":")[1] for line in lines] == [" joint joint1", " joint joint2"]


def test_a_limit_that_the_plant_was_given_by_hand_is_meant_and_needs_no_warning():
    weak = fp.Experiment(fp.Arm.two_link(), Hold(0.0), plant=fp.Plant(effort_limit=5.0))
    assert len(weak.joints_that_fall()) == 2
    assert weak.joints_that_fall(by_hand=False) == []


# ---------------------------------------------------------------------- what cannot be meant

ARM = fp.Arm.two_link()
LAW = fp.Pid(kp=300.0, ki=0.0, kd=60.0)
TABLE = {"mass": 0.5, "com": [0.0, 0.1, 0.0], "frame": "link1"}


@pytest.mark.parametrize(
    ("given", "fields"), [(3, {"mass": 3.0}), ({"mass": 3.0}, {"mass": 3.0}), (TABLE, TABLE)]
)
def test_a_plant_holds_what_the_arm_with_that_payload_does_in_python_and_in_files(given, fields):
    loaded = ARM.with_payload(**fields)
    heavier = ARM.with_scaled_links(mass=1.5)
    for plant in (fp.Plant(payload=given), descriptions.from_dict({"payload": given}, fp.Plant)):
        again = descriptions.from_dict(descriptions.to_dict(plant), fp.Plant)
        for one in (plant, again):
            assert one.resolve(ARM).arm == loaded
            other = dataclasses.replace(one, arm=heavier)
            assert other.resolve(ARM).arm == heavier.with_payload(**fields)
    runs = [
        fp.simulate(fp.Experiment(ARM, Hold(0.3), duration=0.05, plant=p), LAW)
        for p in (fp.Plant(payload=given), fp.Plant(arm=loaded))
    ]
    assert np.array_equal(runs[0].q, runs[1].q)
    assert fp.simulate(runs[0].experiment, LAW).q.tolist() == runs[0].q.tolist()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (-1, r"plant\.payload\.mass: expected a number >= 0, got -1"),
        ("x", r"plant\.payload\.mass: expected a number, got 'x'"),
        ({"mas": 1.0}, r"plant\.payload\.mas: .*did you mean mass\?"),
        ({"mass": 1.0, "frame": "lnk1"}, r"plant\.payload\.frame: .*did you mean link1\?"),
    ],
)
def test_what_no_plant_can_hold_is_named(given, words):
    with pytest.raises(ArgumentError, match=words):
        fp.Experiment(ARM, Hold(0.3), plant=fp.Plant(payload=given))


LIMITED = ARM.with_limits(lower=-0.5, upper=0.5)


@pytest.mark.parametrize(
    ("arm", "reference", "q0", "asked"),
    [
        (ARM, Hold((30.0, 0.0)), 0.0, "joint1 is to go to 30 rad: degrees"),
        (LIMITED, Hold((0.1, 3.0)), 0.0, r"joint2 .* 3 rad \(limits -0.5 and 0.5"),
        (ARM, Hold(0.0), (0.0, 45.0), "joint2 is to go to 45 rad: degrees"),
        (ARM, Hold(6.28), 6.28, None),
        (LIMITED, Hold(2.4), 0.0, None),
    ],
)
def test_degrees_are_asked_of_once_where_radians_cannot_be_meant(arm, reference, q0, asked):
    experiment = fp.Experiment(arm, reference, q0=q0, duration=0.01)
    with warnings.catch_warnings(record=True) as seen:
        warnings.simplefilter("always")
        fp.simulate([experiment, experiment], LAW)
    told = [str(warning.message) for warning in seen]
    assert len(told) == (asked is not None)
    if asked:
        with pytest.warns(fp.FpidWarning, match=asked):
            fp.simulate(experiment, LAW)


def test_a_slide_that_is_to_go_far_is_asked_nothing():
    parts = link("base"), link("cart"), joint("x", "base", "cart", "prismatic")
    arm = fp.Arm.from_urdf(urdf=robot(*parts))
    fp.simulate(fp.Experiment(arm, Hold(20.0), duration=0.01), LAW)


E = fp.paper_experiment(duration=0.01)


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda: fp.simulate(LAW, E), "the experiment first, then the controller"),
        (lambda: fp.evaluate(LAW, [E]), "the experiment first, then the controller"),
        (lambda: fp.simulate(E, fp.Pid), "controller: expected a Controller, got the class Pid"),
        (lambda: fp.simulate(fp.Experiment, LAW), "an Experiment, got the class Experiment"),
        (lambda: fp.evaluate(E, [LAW, fp.Pid]), "controller: .* got the class Pid"),
        (
            lambda: fp.compare(LAW, E),
            "expected an Experiment or a dictionary, got Pid",
        ),
        (lambda: fp.compare(E, fp.Pid), "controllers: .* got the class Pid"),
        (lambda: fp.tune(LAW, E, fp.tuning.Space(kp=(1, 2))), "an Experiment, got Pid"),
        (lambda: fp.tune(E, fp.Pid, fp.tuning.Space(kp=(1, 2))), "got the class Pid"),
        (lambda: fp.Experiment(fp.Arm, Hold(0.0)), "arm: expected an Arm, got the class Arm"),
        (lambda: fp.Experiment(ARM, Hold), "reference: .* got the class Hold"),
        (lambda: fp.simulate(E, "pid"), "controller: expected a Controller, got str"),
        (lambda: fp.simulate(["x"], LAW), "experiment: expected an Experiment, got str"),
        (lambda: fp.simulate([E] * 2, [LAW] * 3), "equal numbers, or one of either, got 2 and 3"),
    ],
)
def test_what_is_swapped_or_a_class_is_one_clear_line(call, words):
    with pytest.raises(ArgumentError, match=words) as caught:
        call()
    assert "\n" not in str(caught.value)
