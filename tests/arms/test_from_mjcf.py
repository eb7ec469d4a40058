"""MJCF arms against MuJoCo itself: M, bias, gravity, limits, losses, at random states."""

import os
import sys

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import LIFTER, write

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError, FpidError, FpidWarning

J = '<joint name="j" axis="0 1 0"/>'
I = '<inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/>'  # noqa: E741
Q, V = [-0.7, 0.2, 1.1], [0.5, -0.3, 0.8]


def world(inside="", before="", after="", base='pos="0 0 0"'):
    """One joint on a base, unless written otherwise."""
    body = f'<body name="b" {base}><body name="l">{inside or J + I}</body></body>'
    return f"<mujoco>{before}<worldbody>{body}</worldbody>{after}</mujoco>"


def agree(arm, path, seed=0, tolerance=1e-10):
    """Compare an arm with MuJoCo's compiled model, whose other joints stand at qpos0."""
    m = mujoco.MjModel.from_xml_path(str(path))
    m.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    d, full = mujoco.MjData(m), np.zeros((m.nv, m.nv))
    joints = [m.joint(name) for name in arm.joint_names]
    at, dofs = [int(j.qposadr[0]) for j in joints], [int(j.dofadr[0]) for j in joints]
    rng = np.random.default_rng(seed)
    for _ in range(5):
        q, v = rng.uniform(-2.0, 2.0, (2, arm.n))
        d.qpos[:], d.qvel[:] = m.qpos0, 0.0
        d.qpos[at], d.qvel[dofs] = q, v
        mujoco.mj_forward(m, d)
        mujoco.mj_fullM(m, d, full)
        scale = max(1.0, np.abs(full).max())
        mass, bias = full[np.ix_(dofs, dofs)], d.qfrc_bias[dofs]
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=tolerance * scale)
        found = arm.inverse_dynamics(q, v, np.zeros(arm.n))
        np.testing.assert_allclose(found, bias, rtol=0, atol=tolerance * max(1, np.abs(bias).max()))
        lost = arm.viscous_friction * v + arm.dry_friction * 0.0
        np.testing.assert_allclose(-d.qfrc_damper[dofs], lost, rtol=1e-12, atol=1e-12)
    assert arm.dry_friction.tolist() == m.dof_frictionloss[dofs].tolist()
    for joint, lower, upper in zip(joints, arm.lower, arm.upper, strict=True):
        limits = joint.range.tolist() if m.jnt_limited[joint.id] else [-np.inf, np.inf]
        assert [lower, upper] == limits


def driven(actuators, joint=J):
    return world(joint + I, after=f"<actuator>{actuators}</actuator>")


EFFORTS = {
    "no actuators": (world(before='<option><flag gravity="disable"/></option>'), np.inf),
    "a general one": (driven('<general joint="j" ctrlrange="-1 1" gear="50"/>'), 50.0),
    "a range of control that is switched off": (
        driven('<motor joint="j" ctrlrange="-1 1" ctrllimited="false" gear="50"/>'), np.inf),
    "a force range in a class": (
        world(before='<default><general forcerange="-7 7"/></default>',
              after='<actuator><position joint="j" kp="9"/></actuator>'), 7.0),
    "two of a joint": (
        driven('<motor joint="j" ctrlrange="-1 1" gear="5"/>'
               '<motor joint="j" ctrlrange="-1 1" gear="-2"/>'), 7.0),
    "the joint's own limit": (
        driven('<motor joint="j" ctrlrange="-1 1" gear="5"/>',
               '<joint name="j" axis="0 1 0" actuatorfrcrange="-4 4"/>'), 4.0),
}  # fmt: skip


@pytest.mark.parametrize("case", EFFORTS)
def test_an_effort_limit_is_what_actuators_and_joint_leave(case, tmp_path):
    text, effort = EFFORTS[case]
    path = write(tmp_path, text)
    arm = Arm.from_mjcf(path)
    assert arm.effort_limit[0] == effort
    agree(arm, path)


NAMES = st.sampled_from(["a", "b", ""])
SMALL_NUMBERS = st.floats(-1.0, 1.0).map(lambda x: round(x, 3))
POSITIVE = st.floats(0.05, 1.0).map(lambda x: round(x, 3))


def attributes(**given):
    """Draw some of these attributes, each a strategy of texts."""
    return st.fixed_dictionaries({}, optional=given).map(
        lambda found: " ".join(f'{key}="{value}"' for key, value in found.items())
    )


def vector(n, numbers=SMALL_NUMBERS):
    return st.lists(numbers, min_size=n, max_size=n).map(lambda xs: " ".join(map(str, xs)))


DIRECTION = vector(3).filter(lambda text: max(abs(float(x)) for x in text.split()) > 0.1)
ANGLED = DIRECTION.flatmap(lambda axis: st.sampled_from([f"{axis} 30", f"{axis} -70.5"]))
PLACE = st.one_of(
    attributes(pos=vector(3)), attributes(pos=vector(3), euler=vector(3)),
    attributes(pos=vector(3), axisangle=ANGLED), attributes(zaxis=DIRECTION),
    attributes(quat=vector(4, POSITIVE)),
)  # fmt: skip
JOINT = attributes(
    type=st.sampled_from(["hinge", "slide"]), axis=DIRECTION, pos=vector(3), damping=POSITIVE,
    armature=POSITIVE, frictionloss=POSITIVE, ref=SMALL_NUMBERS, range=st.just("-1 0.5"),
    limited=st.sampled_from(["true", "false", "auto"]),
).filter(lambda text: 'limited="true"' not in text or "range" in text)  # fmt: skip
GEOM = st.tuples(
    attributes(
        type=st.sampled_from(["sphere", "box", "capsule", "ellipsoid", "cylinder"]),
        density=st.sampled_from([100, 700]), mass=POSITIVE,
    ),
    vector(3, POSITIVE).map(lambda size: f'size="{size}"'), PLACE,
).map(" ".join)  # fmt: skip
INERTIAL = st.tuples(
    POSITIVE, vector(3),
    st.sampled_from(['diaginertia=".1 .12 .2"', 'fullinertia=".2 .3 .25 .01 .02 -.03"']),
).map(lambda t: f'<inertial mass="{t[0]}" pos="{t[1]}" {t[2]}/>')  # fmt: skip


@st.composite
def models(draw):
    """Draw chains whose numbers come from defaults, nested classes and the elements themselves."""
    classes = "".join(
        f'<default class="{name}"><joint {draw(JOINT)}/><geom {draw(GEOM)}/></default>'
        for name in "ab"
    )
    compiler = draw(attributes(
        angle=st.sampled_from(["radian", "degree"]), eulerseq=st.sampled_from(["xyz", "ZYX"]),
        inertiafromgeom=st.sampled_from(["auto", "true"]), autolimits=st.just("true"),
    ))  # fmt: skip
    text = end = ""
    count = draw(st.integers(1, 4))
    for k in range(count):
        named = draw(NAMES)
        own = f'class="{named}"' if named else ""
        text += f'<body name="l{k}" {draw(PLACE)} {draw(attributes(childclass=st.just("a")))}>'
        text += f'<joint name="j{k}" {own} {draw(JOINT)}/>'
        text += draw(st.one_of(st.just(""), INERTIAL)) + f"<geom {own} {draw(GEOM)}/>"
        end += "</body>"
    motors = "".join(
        f'<motor joint="j{k}" ' + draw(attributes(
            gear=SMALL_NUMBERS.filter(bool), armature=POSITIVE, damping=POSITIVE)) + "/>"
        for k in range(count)
    )  # fmt: skip
    return (
        f"<mujoco><compiler {compiler}/><option gravity='{draw(vector(3))}'/><default>"
        f"<joint {draw(JOINT)}/>{classes}</default><worldbody><body name='base' {draw(PLACE)}>"
        f"{text}{end}</body></worldbody><actuator>{motors}</actuator></mujoco>"
    )


@settings(max_examples=60)
@given(text=models())
def test_generated_models_move_as_in_mujoco(text, tmp_path_factory):
    path = write(tmp_path_factory.mktemp("mjcf"), text)
    agree(Arm.from_mjcf(path), path, tolerance=1e-9)


@pytest.fixture
def lifter(tmp_path):
    return Arm.from_mjcf(write(tmp_path, LIFTER, "lifter.xml"))


def test_an_arm_as_people_write_it(lifter, tmp_path):
    agree(lifter, tmp_path / "lifter.xml")
    m = mujoco.MjModel.from_xml_string(LIFTER)
    d = mujoco.MjData(m)
    d.qpos[:] = Q
    mujoco.mj_kinematics(m, d)
    assert lifter.tool_pose(Q)[:3, 3] == pytest.approx(d.site("tool").xpos, rel=1e-12)
    assert lifter.units == ("rad", "m", "rad")
    assert lifter.effort_limit.tolist() == [40.0, 7.0, 7.0]
    assert lifter.home.tolist() == [-0.5, 0.1, 0.2]
    assert (lifter.name, lifter.tool) == ("lifter", "tool")


def test_the_file_and_mujoco_are_not_needed_again(lifter, tmp_path, monkeypatch):
    table = descriptions.to_dict(lifter)
    (tmp_path / "lifter.xml").unlink()
    monkeypatch.setitem(sys.modules, "mujoco", None)
    again = descriptions.from_dict(table, Arm)
    assert again == lifter
    assert len(again.visual()[1].geometryObjects) == len(lifter.visual()[1].geometryObjects) == 3


def test_without_mujoco_one_line_says_how_to_install_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(FpidError, match=r"pip install 'fpid_pin\[mujoco\]'"):
        Arm.from_mjcf(write(tmp_path, world()))


def test_meshes_are_drawn_where_mujoco_has_them(tmp_path):
    """Its compiler moves them to their centre of mass and principal axes."""
    corners = np.array([[1.0, 0, 0], [2, 0, 0], [1, 3, 0], [1, 0, 5]])
    faces = "f 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in corners)
    write(tmp_path, vertices + faces, "t.obj")
    geom = '<geom type="mesh" mesh="t" pos=".1 .2 .3" euler="10 20 30" rgba="1 0 0 1"/>'
    asset = '<asset><mesh name="t" file="t.obj" scale="1 2 .5"/></asset>'
    path = write(tmp_path, world(J + geom, asset))
    arm = Arm.from_mjcf(path)
    agree(arm, path)
    (drawn,) = arm.visual()[1].geometryObjects
    m = mujoco.MjModel.from_xml_path(str(path))
    d = mujoco.MjData(m)
    mujoco.mj_kinematics(m, d)
    theirs = m.mesh_vert @ d.geom_xmat[0].reshape(3, 3).T + d.geom_xpos[0]
    placed = np.array(drawn.geometry.vertices()) @ drawn.placement.rotation.T
    ours = placed + drawn.placement.translation
    assert np.allclose(sorted(map(tuple, ours)), sorted(map(tuple, theirs)), atol=1e-6)
    assert drawn.meshColor.tolist() == [1.0, 0.0, 0.0, 1.0]
    (tmp_path / "t.obj").unlink()
    with pytest.raises(ArmError, match="MuJoCo cannot compile it: .*t.obj"):
        Arm.from_mjcf(path)


# ---------------------------------------------------------------------- grippers and scenes

FINGERS = (
    '<body name="f"><joint name="f" type="slide" range=".01 .04"/>' + I + '<site name="f"/></body>'
    '<body name="g" pos="0 .1 0"><joint name="g" type="slide"/>' + I + "</body>"
)
HAND = world(
    J + I + f'<body name="h" pos=".2 0 0"><joint name="k" axis="0 1 0"/>{I}{FINGERS}</body>'
)


def test_the_rest_is_held_where_it_is_by_the_tip_or_by_names(tmp_path):
    path = write(tmp_path, HAND)
    arm = Arm.from_mjcf(path, keep="h")
    assert arm.joint_names == ("j", "k")
    agree(arm, path)
    assert arm.tool == "h"
    for same in ({"keep": ["j", "k"]}, {"lock": {"f": 0.0, "g": 0.0}}):
        assert Arm.from_mjcf(path, **same, tool="h") == arm
    with_finger = Arm.from_mjcf(path, keep="f", lock={"k": 0.3})
    assert with_finger.joint_names == ("j", "f")
    table = {"kind": "mjcf", "path": str(path), "keep": "h", "gravity": 9.8}
    assert descriptions.from_dict(table, Arm) == Arm.from_mjcf(path, gravity=9.8, keep="h")


def test_the_refusal_names_all_that_has_to_be_held_and_the_tip_that_is_left(tmp_path):
    path = write(tmp_path, HAND)
    hint = r"branches at joint 'k' into 'f', 'g' \(keep='h' or lock=\{'f': 0, 'g': 0\}\)"
    with pytest.raises(ArmError, match=hint):
        Arm.from_mjcf(path)
    hint = r"\(keep = \"h\" or lock = \{ \"f\" = 0, \"g\" = 0 \}\)"
    with pytest.raises(ArmError, match=hint):
        descriptions.from_dict({"kind": "mjcf", "path": str(path)}, Arm)
    with pytest.raises(ArgumentError, match="keep: expected one of .* got 'hh'"):
        Arm.from_mjcf(path, keep="hh")
    # Two arms on a torso are not two fingers.
    arms = ["".join(f'<body name="{s}{k}"><joint/>{I}' for k in range(6)) for s in "xy"]
    with pytest.raises(ArmError, match="joint 'j' into 'joint1', 'joint7' .keep='x5' or lock="):
        Arm.from_mjcf(write(tmp_path, world(J + I + "".join(arm + "</body>" * 6 for arm in arms))))


def test_a_free_base_is_held_where_it_is_drawn(tmp_path):
    free = world(base='pos=".1 .2 .3" euler="10 20 30"')
    path = write(tmp_path, free.replace('<body name="l">', f'<freejoint/>{I}<body name="l">'))
    with pytest.raises(ArmError, match=r"got a free joint, while an arm's base .* \(keep='l'\)$"):
        Arm.from_mjcf(path)
    with pytest.warns(FpidWarning, match="the base, which is free, is held where it is drawn"):
        arm = Arm.from_mjcf(path, keep="l")
    agree(arm, path)


SCENE = world().replace(
    "</worldbody>",
    '<body name="target"><joint name="t" type="slide"/><geom size=".1"/></body><body name="m" '
    'mocap="true"/><body name="box"><freejoint/><geom size=".1"/></body></worldbody>',
)


def test_the_arm_of_a_scene_is_named_by_its_base_or_tip_and_the_rest_is_told(tmp_path):
    path = write(tmp_path, SCENE)
    with pytest.raises(ArmError, match="one body in the world with joints, got 2: 'b', 'target'"):
        Arm.from_mjcf(path)
    for asked in ({"arm": "b"}, {"keep": "l"}):
        with pytest.warns(FpidWarning, match="other bodies that move: 'target', 'm', 'box'"):
            arm = Arm.from_mjcf(path, **asked)
        agree(arm, path)
    with pytest.raises(ArmError, match="got a free joint"):
        Arm.from_mjcf(path, arm="box")
    text = SCENE.replace('<joint name="t" type="slide"/>', "")
    with pytest.warns(FpidWarning, match="other bodies that move: 'm', 'box'"):
        assert Arm.from_mjcf(write(tmp_path, text)).n == 1
    # Of several the one that has most joints, though one that stands free has more.
    text = SCENE.replace(I, f'{I}<body><joint name="k"/>{I}</body>', 1)
    free = f"<body><freejoint/>{I}" + f"<body><joint/>{I}" * 3 + "</body>" * 4
    path = write(tmp_path, text.replace("</worldbody>", f"{free}</worldbody>"))
    with pytest.warns(FpidWarning, match="other bodies that move: 'target', 'm', 'box', ..."):
        arm = Arm.from_mjcf(path)
    assert arm.joint_names == ("j", "k")
    agree(arm, path)


GRIPPER = """<mujoco><worldbody><body name="arm"><joint name="a" axis="0 1 0"/>{inertial}
<body><joint name="finger" type="slide" ref="0.1"/>{inertial}</body>
<body><joint name="follower" type="slide" ref="0.3"/>{inertial}</body></body></worldbody>
<equality><joint joint1="follower" joint2="finger" polycoef="0.01 -2 0 0 0"/></equality></mujoco>"""


def test_a_joint_that_another_leads_follows_its_lock(tmp_path):
    path = write(tmp_path, GRIPPER.replace("{inertial}", I))
    with pytest.raises(ArmError, match=r"keep='arm' or lock=\{'finger': 0.1\}\)"):
        Arm.from_mjcf(path)
    one = Arm.from_mjcf(path, lock={"finger": 0.15})
    # As MuJoCo has it: q - q(0) is the polynomial of the other's.
    both = {"finger": 0.15, "follower": 0.3 + 0.01 - 2.0 * 0.05}
    assert one.joint_names == ("a",)
    assert one.mass_matrix([0.0]) == pytest.approx(Arm.from_mjcf(path, both).mass_matrix([0.0]))
    # A lock of its own counts.
    own = Arm.from_mjcf(path, {"finger": 0.15, "follower": 0.0})
    assert own.mass_matrix([0.0]) != pytest.approx(one.mass_matrix([0.0]))


PULLS = {
    "a spring": (world('<joint name="j" axis="0 1 0" stiffness="3"/>' + I), "'j': left out: a spr"),
    "gravity compensation": (
        world().replace('name="l"', 'name="l" gravcomp="1"'), "'l': left out: gravity comp"),
    "damping": (
        world('<joint name="j" axis="0 1 0" damping="1 2"/>' + I), "'j': left out: damping"),
    "an equality": (
        world(after='<equality><joint joint1="j" polycoef=".1"/></equality>'),
        r"left out: 1 equality constraint\(s\)"),
    "a tendon": (
        world(after='<tendon><fixed><joint joint="j" coef="1"/></fixed></tendon>'),
        r"left out: 1 tendon\(s\)"),
    "a fluid": (world(before='<option density="1.2"/>'), "left out: the fluid around it"),
    "more one way than the other": (
        world(after='<actuator><motor joint="j" ctrlrange="-1 2"/></actuator>'),
        "'j': effort from -1 to 2 is taken as the larger to both sides"),
    "no actuator": (
        world(J + I + '<body><joint name="k"/>' + I + "</body>",
              after='<actuator><motor joint="j"/></actuator>'), "'k': no actuator"),
    "an actuator of a site": (
        world(J + I + '<site name="s"/>',
              after='<actuator><motor joint="j"/><motor site="s"/></actuator>'),
        r"left out: 1 non-joint actuator\(s\)"),
    "what MuJoCo warns of": (
        world(before='<compiler settotalmass="3"/>'), "xml: MuJoCo warns: .*'settotalmass'"),
}  # fmt: skip


@pytest.mark.parametrize("case", PULLS)
def test_what_pulls_at_joints_besides_is_said_to_be_left_out(case, tmp_path, monkeypatch, capfd):
    text, message = PULLS[case]
    monkeypatch.chdir(tmp_path)
    with pytest.warns(FpidWarning, match=message) as caught:
        Arm.from_mjcf(write(tmp_path, text, "arm.xml"))
    assert len(caught) == 1
    # MuJoCo would write to the terminal, and to a file beside.
    assert capfd.readouterr() == ("", "")
    assert os.listdir() == ["arm.xml"]


REFUSED = {
    "what MuJoCo refuses": (world('<joint name="j" axis="0 0 0"/>' + I), "MuJoCo cannot compile"),
    "no mass": (world(J), "MuJoCo cannot compile it: .*mass and inertia of moving bodies"),
    "a ball": (world('<joint type="ball"/>' + I), r"joint 'joint0': .* got a ball joint"),
    "fingers alone": (
        GRIPPER.replace('<joint name="a" axis="0 1 0"/>', "").replace("{inertial}", I),
        "branches at its base into 'finger', 'follower'$"),
    "nothing that moves": (world(I), "one body in the world with joints, got none"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_is_no_arm_is_refused_on_one_line(case, tmp_path):
    text, message = REFUSED[case]
    with pytest.raises(ArmError, match=message) as caught:
        Arm.from_mjcf(write(tmp_path, text))
    assert "\n" not in str(caught.value)
    assert str(caught.value).startswith(str(tmp_path))


def test_the_suggested_law_tracks_in_mujoco_as_here(tmp_path):
    """The loop stepped by MuJoCo: its damping is implicit, too; without limits, dry friction."""
    text = LIFTER.replace('frictionloss="0.3"', "")
    path = write(tmp_path, text, "lifter.xml")
    arm = Arm.from_mjcf(path)
    law = fp.suggest_gains(arm, 8.0)
    reference = fp.references.Sinusoid(amplitude=(0.2, 0.05, 0.3), offset=arm.home)
    run = fp.simulate(fp.Experiment(arm, reference, duration=1.0), law)
    m = mujoco.MjModel.from_xml_path(str(path))
    m.opt.timestep, m.opt.integrator = 1e-3, mujoco.mjtIntegrator.mjINT_EULER
    off = mujoco.mjtDisableBit
    m.opt.disableflags |= int(off.mjDSBL_CONTACT | off.mjDSBL_LIMIT | off.mjDSBL_ACTUATION)
    d, loop = mujoco.MjData(m), law.start(arm, step=1e-3, horizon=1.0)
    d.qpos[:], d.qvel[:] = run.q[0], run.v[0]
    errors = []
    for q_ref, v_ref, a_ref in zip(*reference.sample(run.t), strict=True):
        errors.append(q_ref - d.qpos)
        d.qfrc_applied[:] = loop.torque(d.qpos, d.qvel, q_ref, v_ref, a_ref)
        mujoco.mj_step(m, d)
    assert np.abs(np.array(errors) - run.error).max() < 1e-8
