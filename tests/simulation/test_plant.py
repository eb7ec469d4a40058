"""What a plant holds, and questions that are asked of what cannot be meant."""

import dataclasses
import warnings

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold

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


SLIDE = """<robot name="slide"><link name="base"/><link name="cart"><inertial><mass value="2"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="x" type="prismatic"><parent link="base"/><child link="cart"/><axis xyz="1 0 0"/>
<limit lower="-1" upper="1" effort="40" velocity="10"/></joint></robot>"""


def test_a_slide_that_is_to_go_far_is_asked_nothing():
    arm = fp.Arm.from_urdf(urdf=SLIDE)
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
        (lambda: fp.compare(LAW, E), "experiments: expected an Experiment, .* got Pid"),
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
