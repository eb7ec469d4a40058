"""MJCF arms: MuJoCo's own numbers, and one clear line for what Pinocchio would take for other."""

import warnings

import numpy as np
import pytest
from mjcf_arm import TEXT

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArmError, FpidWarning

Q, V, TAU = [-0.7, 0.2, 1.1], [0.5, -0.3, 0.8], [12.0, -3.0, 0.4]
# MuJoCo 4.0.1, mj_forward without contacts, limits, damping and friction.
MUJOCO_A = [25.362946448216963, -8.022930980243405, 103.50684611499203]
MUJOCO_TOOL = [0.552964395822067, 0.7953727125859497, 1.0254121589243728]
#: An arm of shapes alone, angles in radians, most of it said in classes.
SHAPES = """<mujoco model="g"><compiler angle="radian" eulerseq="zyx" {compiler}/>
<default><geom density="500"/><default class="arm"><joint armature="0.1" axis="0 1 0" damping="2"
range="-1 1" actuatorfrcrange="-50 40"/><geom type="capsule" size="0.03"/>
<default class="wrist"><joint axis="1 0 0" armature="0.01"/><geom {wrist}/></default></default>
</default>
<worldbody><body name="b" childclass="arm" euler="0.3 0.2 0.1" pos="0 0 1">
<geom fromto="0 0 0 0 0 0.2"/><body name="u" pos="0 0 0.2"><joint name="j1"/>
<geom fromto="0 0 0 0.5 0 0"/><geom type="sphere" size="0.05" pos="0.5 0 0" mass="0.4"/>
<geom type="ellipsoid" size="0.05 0.1 0.2" axisangle="1 0 0 0.4"/>
<body name="v" pos="0.5 0 0" zaxis="1 1 0"><joint name="j2" class="wrist"/>
<geom class="wrist" fromto="0 0 0 0 0.2 0.3"/>
<geom type="cylinder" size="0.02 0.2" xyaxes="0 1 0 0 0 1"/>
<body name="f" pos="0 0.1 0"><geom type="box" size="0.1 0.02 0.03"/></body></body></body></body>
</worldbody></mujoco>"""


def write(tmp_path, text, name="arm.xml"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


@pytest.fixture
def lifter(tmp_path):
    return Arm.from_mjcf(write(tmp_path, TEXT))


def test_it_moves_as_mujoco_says(lifter):
    """The base is turned and lifted: Pinocchio's parser alone puts it at the origin, upright."""
    assert lifter.forward_dynamics(Q, V, TAU) == pytest.approx(MUJOCO_A, rel=1e-12)
    assert lifter.tool_pose(Q)[:3, 3] == pytest.approx(MUJOCO_TOOL, rel=1e-12)


def test_shapes_and_classes_weigh_what_they_do_in_mujoco(tmp_path):
    arm = Arm.from_mjcf(write(tmp_path, SHAPES.format(compiler="", wrist='density="300"')))
    found = arm.forward_dynamics([-0.7, 0.2], [0.5, -0.3], [12.0, -3.0])
    assert found == pytest.approx([31.35788348, -95.53106189], rel=1e-9)
    assert arm.effort_limit.tolist() == [40.0, 40.0]


def test_limits_are_those_of_the_file(lifter):
    """Pinocchio's parser alone takes the slide's metres for degrees, and no actuator."""
    assert lifter.units == ("rad", "m", "rad")
    assert lifter.lower == pytest.approx([-np.radians(120), -0.1, -np.inf], rel=1e-12)
    assert (lifter.lower[1], lifter.upper[1]) == (-0.1, 0.5)
    assert lifter.effort_limit.tolist() == [40.0, 7.0, np.inf]
    assert lifter.viscous_friction.tolist() == [0.4, 0.4, 0.1]
    assert lifter.dry_friction.tolist() == [0.3, 0.0, 0.0]
    assert lifter.armature.tolist() == [0.02, 0.0, 0.0]
    assert lifter.home.tolist() == [-0.5, 0.1, 0.2]
    assert (lifter.name, lifter.tool) == ("lifter", "tool")


def test_a_limit_that_is_switched_off_is_none(tmp_path):
    text = TEXT.replace('range="-120 60"', 'range="-120 60" limited="false"')
    arm = Arm.from_mjcf(write(tmp_path, text))
    assert np.isinf([arm.lower[0], arm.upper[0]]).all()


def test_the_file_is_not_needed_again(lifter, tmp_path):
    table = descriptions.to_dict(lifter)
    (tmp_path / "arm.xml").unlink()
    again = descriptions.from_dict(table, Arm)
    assert again == lifter
    assert len(again.visual()[1].geometryObjects) == len(lifter.visual()[1].geometryObjects) == 3


def test_gravity_can_be_another(tmp_path):
    arm = Arm.from_mjcf(write(tmp_path, TEXT), gravity=0.0)
    assert not arm.gravity_vector(Q).any()


def test_a_table_reads_a_file(tmp_path):
    path = write(tmp_path, TEXT)
    table = {"kind": "mjcf", "path": str(path), "lock": {"wrist": 0.3}, "gravity": 9.8}
    assert descriptions.from_dict(table, Arm) == Arm.from_mjcf(path, {"wrist": 0.3}, 9.8)


def test_a_locked_joint_is_still(lifter, tmp_path):
    arm = Arm.from_mjcf(tmp_path / "arm.xml", lock={"slide": 0.2})
    assert arm.joint_names == ("shoulder", "wrist")
    assert arm.tool_pose([-0.7, 1.1]) == pytest.approx(lifter.tool_pose(Q), abs=1e-12)


KEY = '<keyframe><key name="home" qpos="-0.5 0.1 0.2"/></keyframe>'
JOINT = '<joint name="wrist" type="hinge" axis="0.3 0 1" pos="0 0.02 0" damping="0.1"/>'
REFUSED = {
    "negative mass": ('mass="0.7"', 'mass="-0.7"', r"link 'hand': expected a mass >= 0 \[kg\]"),
    "no numbers": ("-0.1 0.5", "x y", r"joint 'slide': expected 2 number\(s\) in range, got 'x y'"),
    "another zero": ('damping="0.1"', 'ref="30"', "'wrist': expected angles from the drawn pose"),
    "ball": (JOINT, '<joint name="wrist" type="ball"/>', "joint 'wrist': expected revolute.*Spher"),
    "two in one": (
        JOINT, JOINT + JOINT.replace("wrist", "second"), "got several joints in one .put a body"),
    "include": ("<worldbody>", '<include file="x.xml"/><worldbody>', "got <include>"),
    "a tree": (
        '<site name="tool"', '<body name="e"><joint name="e"/><geom size="1"/></body>'
        '<body name="f"><joint name="f"/><geom size="1"/></body><site name="tool"',
        "a tree that branches at joint 'wrist' into"),
    "meshes alone": (
        '<geom type="box" size="0.1 0.05 0.04" mass="1.2" pos="0.02 0 0"/>',
        '<geom type="mesh" mesh="m"/>', "body 'carriage': expected an <inertial>, got meshes"),
    "a URDF": ("mujoco", "robot", r"expected a <mujoco> element, got <robot> \(Arm.from_urdf"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_arm_is_refused_on_one_line(case, tmp_path):
    old, new, message = REFUSED[case]
    assert old in TEXT
    with pytest.raises(ArmError, match=message) as caught:
        Arm.from_mjcf(write(tmp_path, TEXT.replace(KEY, "").replace(old, new)))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path))


@pytest.mark.parametrize(
    ("compiler", "wrist", "message"),
    [
        ('settotalmass="9"', "", "expected no settotalmass, .* got '9'"),
        ('boundmass="3"', "", "expected no boundmass"),
        ('autolimits="false"', "", "expected no autolimits"),
        ("", 'mass="0.3"', "body 'u': expected an <inertial> or the mass of each"),
    ],
)
def test_what_mujoco_compiles_and_pinocchio_does_not_is_refused(tmp_path, compiler, wrist, message):
    path = write(tmp_path, SHAPES.format(compiler=compiler, wrist=wrist))
    with pytest.raises(ArmError, match=message):
        Arm.from_mjcf(path)


def test_meshes_that_are_not_there_are_said_and_the_arm_moves_all_the_same(tmp_path, lifter):
    text = TEXT.replace("<worldbody>", '<asset><mesh name="m" file="m.stl"/></asset><worldbody>')
    path = write(tmp_path, text.replace("<site", '<geom type="mesh" mesh="m"/><site'))
    with pytest.warns(FpidWarning, match="visuals cannot be loaded: Could not load .*m.stl"):
        arm = Arm.from_mjcf(path)
    assert arm == lifter


def test_what_pulls_at_joints_besides_is_said_to_be_left_out(tmp_path):
    text = TEXT.replace('damping="0.1"', 'damping="0.1" stiffness="3"').replace(
        "<actuator>",
        '<equality><joint joint1="wrist" joint2="slide"/></equality><actuator>',
    )
    with pytest.warns(FpidWarning, match=r"left out: 1 spring\(s\), 1 equality constraint\(s\)"):
        arm = Arm.from_mjcf(write(tmp_path, text))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert arm.forward_dynamics(Q, V, TAU) == pytest.approx(MUJOCO_A, rel=1e-12)
