"""Reading URDFs: what works, and one clear line for everything that does not."""

import warnings

import numpy as np
import pinocchio as pin
import pytest

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning

BODY = (
    '<inertial><mass value="{m}"/><inertia ixx="{i}" iyy="{i}" izz="{i}" ixy="0" ixz="0" iyz="0"/>'
)
LIMIT = '<limit lower="-2" upper="1" effort="10" velocity="3"/>'


def link(name, mass=1.0, inertia=0.1, visual=""):
    body = BODY.format(m=mass, i=inertia) + "</inertial>"
    return f'<link name="{name}">{body}{visual}</link>'


def joint(name, parent, child, kind="revolute", extra=LIMIT, axis="0 1 0"):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="0.3 0 0"/><axis xyz="{axis}"/>{extra}</joint>'
    )


def robot(*parts):
    return f'<robot name="made">{"".join(parts)}</robot>'


def write(tmp_path, text, name="arm.urdf"):
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return path


TWO = (
    link("base"),
    link("a"),
    link("b"),
    joint("one", "base", "a", extra=LIMIT + '<dynamics damping="0.5" friction="0.2"/>'),
    joint("two", "a", "b", "continuous", '<limit effort="0" velocity="0"/>'),
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


def test_continuous_joints_become_angles(tmp_path):
    path = write(tmp_path, robot(*TWO))
    arm = Arm.from_urdf(path)
    assert (arm.model.nq, arm.model.nv) == (2, 2)
    raw = pin.buildModelFromUrdf(str(path))
    assert raw.nq == 3
    data = raw.createData()
    rng = np.random.default_rng(0)
    for _ in range(50):
        q, v, a = rng.uniform(-7, 7, 2), rng.normal(size=2), rng.normal(size=2)
        circle = np.array([q[0], np.cos(q[1]), np.sin(q[1])])
        tau = pin.rnea(raw, data, circle, v, a)
        np.testing.assert_allclose(arm.inverse_dynamics(q, v, a), tau, atol=1e-13)


def test_limits_left_out_or_infinite_are_none(tmp_path):
    limits = ('<limit lower="-1" upper="2"/>', '<limit lower="-inf" upper="inf" effort="inf"/>')
    parts = [link("base"), link("a"), link("b")]
    parts += [joint("one", "base", "a", extra=limits[0]), joint("two", "a", "b", extra=limits[1])]
    arm = Arm.from_urdf(write(tmp_path, robot(*parts)))
    assert arm.lower.tolist() == [-1, -np.inf]
    assert arm.upper.tolist() == [2, np.inf]
    assert np.isinf(arm.effort_limit).all()
    assert np.isinf(arm.velocity_limit).all()
    assert arm.home.tolist() == [0.5, 0]


def test_prismatic_joints_can_be_locked(tmp_path):
    parts = (link("base"), link("a"), link("b"), link("c"))
    chain = robot(
        *parts,
        joint("one", "base", "a"),
        joint("slide", "a", "b", "prismatic", axis="1 0 0"),
        joint("two", "b", "c"),
    )
    path = write(tmp_path, chain)
    assert Arm.from_urdf(path).units == ("rad", "m", "rad")
    short = Arm.from_urdf(path, lock={"slide": 0.1})
    long = Arm.from_urdf(path, lock={"slide": 0.4})
    assert short.joint_names == ("one", "two")
    reach = [arm.tool_pose(np.zeros(2))[0, 3] for arm in (short, long)]
    assert reach[1] - reach[0] == pytest.approx(0.3)
    assert descriptions.from_dict(descriptions.to_dict(long), Arm) == long


def test_a_tree_is_refused_and_one_branch_of_it_is_an_arm(tmp_path):
    parts = [link("base"), link("a"), link("b"), link("c")]
    parts += [joint("one", "base", "a"), joint("left", "a", "b"), joint("right", "a", "c")]
    path = write(tmp_path, robot(*parts))
    with pytest.raises(ArmError, match=r"branches at joint 'one' into 'left', 'right'"):
        Arm.from_urdf(path)
    assert Arm.from_urdf(path, lock={"right": 0.5}).joint_names == ("one", "left")


def test_links_may_share_their_names_with_joints(tmp_path):
    parts = [link("base"), link("one"), link("two"), link("three")]
    parts += [joint("one", "base", "one"), joint("two", "one", "two")]
    parts += [joint("three", "two", "three")]
    arm = Arm.from_urdf(write(tmp_path, robot(*parts)), lock={"three": 0.2})
    assert arm.joint_names == ("one", "two")
    assert np.isfinite(arm.tool_pose(arm.home)).all()
    assert arm.with_payload(1.0).mass_matrix(arm.home)[0, 0] > arm.mass_matrix(arm.home)[0, 0]


REFUSED = {
    "floating base": (
        robot(link("w"), *TWO, joint("root", "w", "base", "floating", "")),
        "joint 'root': expected revolute, continuous or prismatic, got floating",
    ),
    "no limits": (
        robot(link("base"), link("a"), joint("j", "base", "a", extra="")),
        r"joint 'j' \(revolute\): expected a <limit> element",
    ),
    "two parents": (
        robot(link("x"), link("y"), link("z"), joint("j", "x", "z"), joint("k", "y", "z")),
        "expected one joint above link 'z', got several",
    ),
    "no joints": (robot(link("x")), "expected at least one joint that is free"),
    "mimic": (
        robot(*TWO, link("c"), joint("m", "b", "c", extra=LIMIT + '<mimic joint="one"/>')),
        r"joint 'm': .*got one that mimics 'one' \(lock it: lock=\{'m': 0.0\}\)",
    ),
    "broken XML": ("<robot name='x'><link></robot>", "expected well-formed XML, got mismatched"),
    "massless tip": (
        robot(
            link("base"),
            link("a"),
            link("tip", 0, 0),
            joint("j", "base", "a"),
            joint("k", "a", "tip"),
        ),
        "positive definite mass matrix.*link 'tip' .*joint 'k'",
    ),
    "not a number": (
        robot(link("base"), link("a", "heavy"), joint("j", "base", "a")),
        "link 'a': <mass>: expected a number in value, got 'heavy'",
    ),
    "half an inertia": (
        robot(link("base"), link("a").replace('izz="0.1"', ""), joint("j", "base", "a")),
        "link 'a': <inertia>: expected the attribute izz, got none",
    ),
    "flat axis": (
        robot(link("base"), link("a"), joint("j", "base", "a", axis="0 1")),
        "joint 'j': <axis>: expected 3 numbers in xyz, got '0 1'",
    ),
}


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_what_is_no_arm_is_refused_on_one_line(text, message, tmp_path, capfd):
    with pytest.raises(ArmError, match=message) as caught:
        Arm.from_urdf(write(tmp_path, text))
    assert "\n" not in str(caught.value)
    # Nothing but the error: urdfdom writes to the terminal when it is asked.
    assert capfd.readouterr() == ("", "")


def test_massless_elbow_is_named_although_it_is_regular_when_bent(tmp_path):
    """Point masses only: with none on link 1 the straight arm has no inertia across."""

    def point(name, mass):
        return (
            f'<link name="{name}"><inertial><origin xyz="1 0 0"/><mass value="{mass}"/>'
            '<inertia ixx="0" iyy="0" izz="0" ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )

    text = robot(
        link("base"),
        point("upper", 0),
        point("fore", 1),
        joint("j", "base", "upper"),
        joint("k", "upper", "fore").replace("0.3", "1"),
    )
    with pytest.raises(ArmError, match="link 'upper'"):
        Arm.from_urdf(write(tmp_path, text))
    text = text.replace('<mass value="0"/>', '<mass value="0.1"/>')
    assert Arm.from_urdf(write(tmp_path, text)).n == 2


def test_missing_files_and_folders(tmp_path):
    with pytest.raises(ArmError, match=r"nothing\.urdf: expected a URDF file, got none"):
        Arm.from_urdf(tmp_path / "nothing.urdf")
    with pytest.raises(ArmError, match="expected a URDF file, got a folder"):
        Arm.from_urdf(tmp_path)
    (tmp_path / "binary.urdf").write_bytes(b"\xff\xfe\x00robot")
    with pytest.raises(ArmError, match="cannot be read"):
        Arm.from_urdf(tmp_path / "binary.urdf")


@pytest.mark.parametrize(
    ("lock", "message"),
    [
        ({"oen": 0.0}, r"lock: .*did you mean one\?"),
        ({"one": np.nan}, r"lock\.one: .*got nan"),
    ],
)
def test_bad_locks_are_named(lock, message, tmp_path):
    with pytest.raises(ArgumentError, match=message):
        Arm.from_urdf(write(tmp_path, robot(*TWO)), lock=lock)


MESH = '<visual><geometry><mesh filename="{}"/></geometry></visual>'
BALL = '<visual><geometry><sphere radius="0.1"/></geometry></visual>'


def meshed(tmp_path, address, folder=None):
    parts = [link("base"), link("a", visual=MESH.format(address)), link("b", visual=BALL)]
    parts += [joint("one", "base", "a"), joint("two", "a", "b")]
    where = tmp_path if folder is None else folder
    where.mkdir(parents=True, exist_ok=True)
    return write(where, robot(*parts))


TETRAHEDRON = """solid t
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
facet normal 0 1 0
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 0 1
endloop
endfacet
endsolid t
"""


def test_missing_meshes_are_said_once_and_the_dynamics_work(tmp_path):
    arm = Arm.from_urdf(meshed(tmp_path, "package://my_robot/meshes/a.stl"))
    assert arm.mass_matrix(arm.home).shape == (2, 2)
    with pytest.warns(FpidWarning, match=r"1 mesh file\(s\) not found, first 'package://my_rob"):
        model, geometry = arm.visual()
    assert geometry.ngeoms == 1
    assert model.nq == 2
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        arm.visual()


@pytest.mark.parametrize(
    "address", ["package://my_robot/meshes/a.stl", "meshes/a.stl", "file://{}/meshes/a.stl"]
)
def test_meshes_are_found_beside_and_above_the_file(address, tmp_path):
    package = tmp_path / "my_robot"
    (package / "meshes").mkdir(parents=True)
    (package / "meshes" / "a.stl").write_text(TETRAHEDRON)
    # As in a ROS package: the URDF in a folder of its own beside the meshes.
    folder = package if address.startswith("meshes") else package / "urdf"
    arm = Arm.from_urdf(meshed(tmp_path, address.format(package), folder))
    _, geometry = arm.visual()
    assert geometry.ngeoms == 2


def test_package_dirs_say_where_to_look(tmp_path):
    away = tmp_path / "away" / "my_robot" / "meshes"
    away.mkdir(parents=True)
    (away / "a.stl").write_text(TETRAHEDRON)
    path = meshed(tmp_path, "package://my_robot/meshes/a.stl", tmp_path / "here" / "x" / "y")
    arm = Arm.from_urdf(path, package_dirs=[tmp_path / "away"])
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
    at = {g.name: p.translation for g, p in zip(geometry.geometryObjects, drawn.oMg, strict=True)}
    np.testing.assert_allclose(at["link1_2"], (0, 0, 1), atol=1e-12)
    np.testing.assert_allclose(at["link2_2"], (0.8, 0, 1), atol=1e-12)
    assert len(at) == 7
    geometry.geometryObjects[0].meshPath = "spoilt"
    assert arm.visual()[1].geometryObjects[0].meshPath != "spoilt"
