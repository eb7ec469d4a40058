"""Reading URDFs: what works, and one clear line for everything that does not."""

import warnings

import numpy as np
import pinocchio as pin
import pytest
from robots import LIMIT, joint, link, robot, write

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning

TWO = (
    link("base"),
    link("a"),
    link("b"),
    joint("one", "base", "a", extra=LIMIT + '<dynamics damping="0.5" friction="0.2"/>'),
    joint("two", "a", "b", "continuous", ""),
)


def test_limits_friction_and_home_come_from_the_file(tmp_path):
    arm = Arm.from_urdf(write(tmp_path, robot(*TWO)))
    assert arm.name == "made"
    assert arm.joint_names == ("one", "two")
    assert arm.lower.tolist() == [-2, -np.inf]
    assert arm.upper.tolist() == [1, np.inf]
    assert arm.effort_limit.tolist() == [10, np.inf]
    assert arm.velocity_limit.tolist() == [3, np.inf]
    assert arm.viscous_friction.tolist() == [0.5, 0]
    assert arm.dry_friction.tolist() == [0.2, 0]
    assert arm.home.tolist() == [-0.5, 0]
    assert arm.gravity == 9.81
    assert arm.tool == "b"
    assert Arm.from_urdf(write(tmp_path, robot(*TWO)), gravity=1.6).gravity == 1.6


def test_limits_left_out_or_infinite_are_none(tmp_path):
    limits = ('<limit lower="-1" upper="2"/>', '<limit lower="-inf" upper="inf" effort="inf"/>')
    parts = [link("base"), link("a"), link("b")]
    parts += [joint("one", "base", "a", extra=limits[0]), joint("two", "a", "b", extra=limits[1])]
    arm = Arm.from_urdf(write(tmp_path, robot(*parts)))
    assert (arm.lower.tolist(), arm.upper.tolist()) == ([-1, -np.inf], [2, np.inf])
    assert np.isinf([arm.effort_limit, arm.velocity_limit]).all()


def test_joints_can_be_locked_and_links_may_share_their_names(tmp_path):
    slide = joint("b", "a", "b", "prismatic", axis="1 0 0")
    parts = map(link, ("base", "a", "b", "c"))
    chain = robot(*parts, joint("a", "base", "a"), slide, joint("c", "b", "c"))
    path = write(tmp_path, chain)
    assert Arm.from_urdf(path).units == ("rad", "m", "rad")
    short, long = (Arm.from_urdf(path, lock={"b": x}) for x in (0.1, 0.4))
    assert short.joint_names == ("a", "c")
    reach = [arm.tool_pose(np.zeros(2))[0, 3] for arm in (short, long)]
    assert reach[1] - reach[0] == pytest.approx(0.3)
    assert descriptions.from_dict(descriptions.to_dict(long), Arm) == long


MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
BALL = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'


def meshed(tmp_path, address, folder=None):
    parts = [link("base"), link("a", visual=MESH.format(address)), link("b", visual=BALL)]
    parts += [joint("one", "base", "a"), joint("two", "a", "b")]
    where = tmp_path if folder is None else folder
    where.mkdir(parents=True, exist_ok=True)
    return write(where, robot(*parts))


TRIANGLES = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 3\nf 1 2 4\n"


@pytest.mark.parametrize(
    "address", ["package://my_robot/meshes/a.obj", f"package://{'n' * 300}/n", "a\x7fb"]
)
def test_missing_meshes_are_said_once_and_the_dynamics_work(address, tmp_path):
    arm = Arm.from_urdf(meshed(tmp_path, address))
    assert arm.mass_matrix(arm.home).shape == (2, 2)
    with pytest.warns(FpidWarning, match=r"1 mesh file\(s\) not found or not read") as caught:
        model, geometry = arm.visual()
    text = str(caught[0].message)
    assert text.isprintable()
    assert len(text) < 400
    assert geometry.ngeoms == 1
    assert model.nq == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arm.visual()


@pytest.mark.parametrize(
    ("address", "folder"),
    # As in a ROS package the URDF has a folder beside the meshes; or `package_dirs` says where.
    [("meshes/a.obj", "away/my_robot"), ("file://{}/meshes/a.obj", "away/my_robot/urdf"),
     ("package://my_robot/meshes/a.obj", "away/my_robot/urdf"),
     ("package://my_robot/meshes/a.obj", "here/x/y")],
)  # fmt: skip
def test_meshes_are_found_beside_and_above_the_file_and_where_told(address, folder, tmp_path):
    package = tmp_path / "away" / "my_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "meshes" / "a.obj").write_text(TRIANGLES)
    path = meshed(tmp_path, address.format(package), tmp_path / folder)
    told = {"package_dirs": [tmp_path / "away"]} if folder.startswith("here") else {}
    arm = Arm.from_urdf(path, **told)
    assert arm.visual()[1].ngeoms == 2
    assert descriptions.from_dict(descriptions.to_dict(arm), Arm).visual()[1].ngeoms == 2


def test_a_table_with_a_path_reads_the_file_and_one_with_text_needs_none(tmp_path):
    path = write(tmp_path, robot(*TWO))
    arm = descriptions.from_dict({"kind": "urdf", "path": str(path)}, Arm)
    table = descriptions.to_dict(arm)
    path.unlink()
    assert descriptions.from_dict(table, Arm) == arm
    with pytest.raises(ArmError, match="expected a URDF file, got none"):
        descriptions.from_dict({"kind": "urdf", "path": str(path)}, Arm)


def test_visuals_of_the_two_link_arm_are_in_place():
    arm = Arm.two_link()
    model, geometry = arm.visual()
    data, drawn = model.createData(), geometry.createData()
    pin.forwardKinematics(model, data, np.array([np.pi / 2, -np.pi / 2]))
    pin.updateGeometryPlacements(model, data, geometry, drawn)
    balls = [k for k, g in enumerate(geometry.geometryObjects) if hasattr(g.geometry, "radius")
             and not hasattr(g.geometry, "halfLength")]  # fmt: skip
    at = [drawn.oMg[k].translation for k in balls]
    np.testing.assert_allclose(at, [(0, 0, 1), (0.8, 0, 1)], atol=1e-12)
    assert geometry.ngeoms == 7
    geometry.geometryObjects[0].meshPath = "spoilt"
    assert arm.visual()[1].geometryObjects[0].meshPath != "spoilt"


PLAIN = robot(*TWO)
ACCEPTED = {
    "dashes in a comment": PLAIN.replace("<link", "<!-- a -- b --><link", 1),
    "space before the declaration": '\n  <?xml version="1.0" encoding="utf-8"?>' + PLAIN,
    "another encoding": '<?xml version="1.0" encoding="latin-1"?><!-- é -->' + PLAIN,
    "a prefix that is not declared": PLAIN.replace("</robot>", '<gazebo:x a:b="1"/></robot>'),
    "xacro's namespace": PLAIN.replace("<robot", '<robot xmlns:xacro="http://ros.org/wiki/xacro"'),
    "a default namespace": PLAIN.replace("<robot", '<robot xmlns="http://www.ros.org"'),
    "an element twice": PLAIN.replace(LIMIT, LIMIT * 2),
    "an odd inertia that never moves": PLAIN.replace(link("base"), link("base", 1.0, (-1, 1, 9))),
    "tags of others": PLAIN.replace("</link>", '<contact x="a"/></link><transmission/>'),
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_what_urdfdom_accepts_is_accepted(case, tmp_path):
    text = ACCEPTED[case].encode("latin-1" if case == "another encoding" else "utf-8")
    path = tmp_path / "arm.urdf"
    path.write_bytes(text)
    arm, plain = Arm.from_urdf(path), Arm.from_urdf(write(tmp_path, PLAIN, "plain.urdf"))
    assert arm == plain
    assert pin.buildModelFromUrdf(str(path)).nv == 2


def test_an_inertia_that_no_body_has_can_be_put_right_or_accepted(tmp_path):
    """By hand: (1, 1, 3) has second moments (1.5, 1.5, -0.5); the closest has (a, a, 0), with
    2 (a - 1)^2 + (2 a - 3)^2 least at a = 4/3."""
    turned = '<inertial><origin rpy="0 0 0.7" xyz="0.1 0 0"/>'
    text = robot(link("base"), link("a", 1.0, (1, 1, 3)).replace("<inertial>", turned),
                 joint("j", "base", "a", axis="0 0 1"))  # fmt: skip
    path = write(tmp_path, text)
    with pytest.warns(
        FpidWarning, match=r"'a': inertia changed by 17 % to the closest that a body"
    ):
        arm = Arm.from_urdf(path, inertia="nearest")
    assert np.array(arm.model.inertias[1].inertia) == pytest.approx(np.diag((4, 4, 8)) / 3)
    as_it_is = Arm.from_urdf(path, inertia="accept")
    assert as_it_is.mass_matrix([0.0])[0, 0] == pytest.approx(3.0 + 0.1**2)
    for one in (arm, as_it_is):
        assert descriptions.from_dict(descriptions.to_dict(one), Arm) == one


def limited(text):
    return robot(link("base"), link("a"), joint("j", "base", "a", extra=text))


SAID = {
    "effort 0": (limited(LIMIT.replace("10", "0")), "'j': effort 0 is taken as no limit"),
    "velocity < 0": (limited(LIMIT.replace('"3"', '"-3"')), "'j': velocity -3 is taken as no lim"),
    "effort < 0": (limited(LIMIT.replace("10", "-5")), "'j': effort -5 is taken as no limit"),
    "no room": (
        limited(LIMIT.replace('"1"', '"-3"')), "'j': lower -2 is not below upper -3, taken as no"),
    "continuous": (
        robot(link("base"), link("a"), joint("j", "base", "a", "continuous")),
        "'j': lower and upper are not used, as the joint is continuous"),
    "no mass": (
        robot(link("base"), link("a"), link("b", 0, 1), joint("j", "base", "a"),
              joint("k", "a", "b", "fixed", "")),
        "'b': mass 0 with a rotational inertia, which is kept"),
    "an odd visual": (
        limited(LIMIT).replace("</link>", '<visual><geometry><box size="1 -1 1"/></geometry>'
                               "</visual></link>", 1),
        "'base': a visual without one shape of known size is not drawn"),
}  # fmt: skip


@pytest.mark.parametrize("case", SAID)
def test_nothing_is_changed_in_silence(case, tmp_path):
    text, message = SAID[case]
    with pytest.warns(FpidWarning, match=message) as caught:
        arm = Arm.from_urdf(write(tmp_path, text))
    assert len(caught) == 1
    if "no limit" in message:
        assert np.isinf([arm.effort_limit[0], arm.velocity_limit[0], arm.upper[0]]).any()
        new = arm.with_limits(effort=5, velocity=2, lower=-1, upper=1)
        assert (new.effort_limit[0], new.lower[0], new.upper[0]) == (5, -1, 1)
        with pytest.raises(
            ArgumentError, match="upper limit: expected a number > -1 for j, got -2"
        ):
            new.with_limits(upper=-2)


GRIPPER = robot(
    *TWO, link("f"), link("g"), joint("finger", "b", "f", "prismatic"),
    joint("follower", "b", "g", extra=LIMIT + '<mimic joint="finger" multiplier="2" offset=".1"/>'),
)  # fmt: skip


def test_a_mimic_joint_follows_the_lock_of_its_master(tmp_path):
    path = write(tmp_path, GRIPPER)
    hint = r"joint 'follower': .* mimics 'finger' \(keep='b' or lock=\{'finger': 0\}\)"
    with pytest.raises(ArmError, match=hint):
        Arm.from_urdf(path)
    held = Arm.from_urdf(path, lock={"finger": 0.2}, tool="g")
    by_hand = Arm.from_urdf(path, lock={"finger": 0.2, "follower": 0.5}, tool="g")
    assert held == by_hand
    assert held.joint_names == ("one", "two")
    assert Arm.from_urdf(path, keep="b").tool_pose([0, 0]) == pytest.approx(
        Arm.from_urdf(path, lock={"finger": 0.0}, tool="b").tool_pose([0, 0])
    )
