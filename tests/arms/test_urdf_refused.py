"""Robots that cannot be, or that would stop the process: one line each, and no long wait."""

import pytest
from robots import LIMIT, joint, link, robot, write
from test_from_urdf import MESH

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning

MANY = 8_000


def one_joint(tip, extra=LIMIT, **kind):
    return robot(link("base"), tip, joint("j", "base", "tip", extra=extra, **kind))


#: Point masses only: with none on link 1 the straight arm has no inertia across.
ELBOW = (link("base"), link("upper", 0, 0, com="1 0 0"), link("fore", 1, 0, com="1 0 0"),
         joint("j", "base", "upper"), joint("k", "upper", "fore").replace("0.3", "1"))  # fmt: skip
REFUSED = {
    # In the words of urdfdom and Pinocchio.
    "no limits": (one_joint(link("tip"), ""), r"Joint \[j\] is of type REVOLUTE but it does not"),
    "two bases": (robot(link("x"), link("y")), r"Two root links found: \[x\] and \[y\]"),
    "a cycle": (
        robot(link("x"), link("y"), joint("j", "x", "y"), joint("k", "y", "x")), "No root link"),
    "one name": (robot(link("x"), link("x")), "link 'x' is not unique"),
    "no name": ("<robot/>", "No name given for the robot"),
    "not a number": (
        one_joint(link("tip", "heavy")),
        r"mass \[heavy\] is not a float; Could not parse inertial element for Link \[tip\]"),
    "half an inertia": (
        one_joint(link("tip").replace('izz="0.1"', "")), "missing izz attribute.*Link .tip"),
    "flat axis": (
        one_joint(link("tip"), axis="0 1"), r"Malformed axis element for joint \[j\]"),
    "another type": (one_joint(link("tip"), kind="screw"), r"no known type \[screw\]"),
    # In ours: what those let pass.
    "floating": (
        robot(link("w"), link("base"), link("tip"), joint("j", "base", "tip"),
              joint("root", "w", "base", "floating", "")),
        "joint 'root': expected revolute, continuous or prismatic, got a free joint .*fixed\\)$"),
    "no axis": (one_joint(link("tip"), axis="0 0 0"), "joint 'j': expected axis a unit vector"),
    "no joints": (robot(link("x")), "expected at least one joint that is free"),
    "broken XML": ("<robot name='x'><link></robot>", "expected well-formed XML, got mismatched"),
    "massless tip": (
        robot(link("base"), link("a"), link("tip", 0, 0), joint("j", "base", "a"),
              joint("k", "a", "tip")),
        "positive definite mass matrix.*link 'tip' .*joint 'k'"),
    "massless elbow": (robot(*ELBOW), "link 'upper'"),
    "negative mass": (one_joint(link("tip", -1.0)), r"link 'tip': expected a mass >= 0 .*got -1"),
    "negative moment": (
        one_joint(link("tip", 1.0, (-0.1, 0.2, 0.2))),
        r"link 'tip': expected principal moments of inertia >= 0 .*got -0\.1, 0\.2, 0\.2"),
    "triangle inequality": (
        one_joint(link("tip", 1.0, (0.1, 0.1, 0.3))),
        r"none above the sum of the others, got 0\.1, 0\.1, 0\.3 .inertia = .nearest. takes"),
    "negative damping": (
        one_joint(link("tip"), LIMIT + '<dynamics damping="-0.5"/>'),
        "joint 'j': expected damping a number >= 0, got -0.5"),
    "detached cycle": (
        robot(*map(link, ("base", "tip", "x", "y")), joint("j", "base", "tip"),
              joint("k", "x", "y"), joint("l", "y", "x")),
        "expected every link below the base, got 2 apart: 'x', 'y'"),
    "two inertias": (
        one_joint(link("tip").replace("</inertial>", "</inertial><inertial/>")),
        "link 'tip': expected one <inertial>, got several that differ"),
    "elements within elements": (
        f"<robot>{'<a>' * 101}{'</a>' * 101}</robot>",
        "expected at most 100 elements within one another, got more around <a>"),
    "an entity that grows": (
        '<!DOCTYPE r [<!ENTITY a "' + "ha" * 500 + '">'
        + "".join(f'<!ENTITY {b} "{f"&{a};" * 100}">' for a, b in ("ab", "bc", "cd", "de"))
        + "]><robot>&e;</robot>",
        "expected well-formed XML, got limit on input amplification"),
    "loose links": (robot(*[link(f"l{k}") for k in range(MANY)]), "most 2000 links, got 8000"),
    "many joints": (
        robot(link("l"), *[joint(f"j{k}", "l", f"l{k}") for k in range(201)]),
        "at most 200 joints that are not fixed, got 201"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_on_one_line(case, capfd):
    text, message = REFUSED[case]
    with pytest.raises(ArmError, match=message) as caught:
        descriptions.from_dict({"kind": "urdf", "urdf": text}, Arm)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 600
    # Nothing but the error: urdfdom writes to the terminal.
    assert capfd.readouterr() == ("", "")


def test_an_elbow_with_some_mass_is_regular():
    text = robot(*ELBOW).replace('<mass value="0"/>', '<mass value="0.1"/>')
    assert descriptions.from_dict({"kind": "urdf", "urdf": text}, Arm).n == 2


def test_another_file_is_not_read(tmp_path):
    secret = write(tmp_path, "secret", "secret.txt")
    text = f'<!DOCTYPE r [<!ENTITY a SYSTEM "file://{secret}">]><robot>&a;</robot>'
    with pytest.raises(ArmError) as caught:
        Arm.from_urdf(write(tmp_path, text))
    assert "secret" not in str(caught.value).replace(str(tmp_path), "")


@pytest.mark.parametrize(
    "diagonal", [(0, 0.1, 0.1), (0.1, 0.2, 0.302), (0, 0, 0), (-2.4e-35, 0, 2.4e-35)]
)
def test_rods_plates_points_and_rounded_numbers_are_bodies(diagonal):
    tip = link("tip", 1.0, diagonal, com="0.1 0 0")
    table = {"kind": "urdf", "urdf": one_joint(tip)}
    assert descriptions.from_dict(table, Arm).n == 1


def test_deep_chains_are_arms():
    parts = [link(f"l{k}") for k in range(1500)]
    parts += [joint(f"j{k}", f"l{k}", f"l{k + 1}", "fixed", "") for k in range(1499)]
    parts += [link("tip"), joint("j", "l1499", "tip")]
    arm = descriptions.from_dict({"kind": "urdf", "urdf": robot(*parts)}, Arm)
    assert arm.tool_pose([0.0])[0, 3] == pytest.approx(1500 * 0.3)


LONG = "n" * 300


@pytest.mark.parametrize(
    ("read", "path", "message"),
    [
        (Arm.from_urdf, "none.urdf", r"none\.urdf: expected a URDF file, got none"),
        (Arm.from_urdf, ".", "expected a URDF file, got a folder"),
        (Arm.from_urdf, "binary.urdf", "expected well-formed XML"),
        (Arm.from_urdf, f"{LONG}.urdf", "cannot be read: File name too long"),
        (Arm.from_urdf, "a\0b.urdf", "expected a URDF file, got none"),
        (Arm.from_file, "none.urdf", "expected a URDF or MJCF file, got none"),
    ],
)
def test_a_path_that_has_no_robot_is_one_line(tmp_path, monkeypatch, read, path, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "binary.urdf").write_bytes(b"\xff\xfe\x00robot")
    with pytest.raises(ArmError, match=message) as caught:
        read(path)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("address", [f"package://{LONG}/{LONG}", "a\x7fb"])
def test_a_mesh_of_such_a_path_is_a_missing_one(address, tmp_path):
    parts = [link("base"), link("tip", visual=MESH.format(address)), joint("j", "base", "tip")]
    arm = Arm.from_urdf(write(tmp_path, robot(*parts)))
    with pytest.warns(FpidWarning, match=r"1 mesh file\(s\) not found") as caught:
        arm.visual()
    text = str(caught[0].message)
    assert text.isprintable()
    assert len(text) < 400


@pytest.mark.parametrize(
    ("entry", "message"),
    [
        ({"path": 5}, "path: expected the path of a URDF file, got int"),
        ({"urdf": 5}, "urdf: expected the text of a URDF, got 5"),
        ({"package_dirs": 5}, "package_dirs: expected a list of folders, got int"),
        ({"package_dirs": [5]}, "package_dirs.0: expected a folder, got int"),
        ({"inertia": "near"}, r"inertia: expected one of .*did you mean nearest\?"),
        ({"keep": 5}, "keep: expected joints' names, or the link at the arm's tip, got int"),
        ({"tool": "tpi"}, r"tool: expected one of .*did you mean tip\?"),
        ({"lock": {"k": 0.0}}, "lock: expected one of j, got 'k'"),
        ({"lock": {"j": float("nan")}}, r"lock\.j: .*got nan"),
    ],
)
def test_odd_entries_of_a_table_are_refused(entry, message):
    table = {"kind": "urdf", "urdf": one_joint(link("tip"))}
    with pytest.raises(ArgumentError, match=message):
        descriptions.from_dict(table | entry, Arm)
