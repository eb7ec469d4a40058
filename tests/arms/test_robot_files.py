"""Which kind a robot's file is, what is refused in one line, and robots that are downloaded."""

import sys
from pathlib import Path

import numpy as np
import pytest
from robots import LIFTER as MJCF
from robots import LIMIT, joint, link, robot, write

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError, ArmError

XACRO = (
    '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="r">'
    '<xacro:property name="m" value="1"/><link name="a"/></robot>'
)


TWO_LINK = (Path(__file__).parents[2] / "urdf" / "two_link.urdf").read_text(encoding="utf-8")
# Of limits that are 0 a warning tells.
TWO_LINK = TWO_LINK.replace('effort="0" velocity="0"', "")


@pytest.mark.parametrize("name", ["arm.urdf", "arm"])
def test_the_root_element_says_what_a_file_is(tmp_path, name):
    path = write(tmp_path, TWO_LINK, name)
    assert Arm.from_file(path, gravity=9.8) == Arm.from_urdf(path, gravity=9.8)
    path.write_text(MJCF, encoding="utf-8")
    assert Arm.from_file(path, lock={"slide": 0.1}) == Arm.from_mjcf(path, {"slide": 0.1})


@pytest.mark.parametrize("text", [XACRO, '<robot name="${name}"/>'])
@pytest.mark.parametrize("read", [Arm.from_file, Arm.from_urdf, Arm.from_mjcf])
def test_macros_are_refused_with_the_command_that_writes_them_out(tmp_path, read, text):
    path = write(tmp_path, text, "my arm.urdf.xacro")
    with pytest.raises(ArmError, match=r"run: xacro '.*/my arm.urdf.xacro' > robot.urdf") as caught:
        read(path)
    assert "\n" not in str(caught.value)


LONG = "n" * 300
DEEP = "<a>" * 101 + "</a>" * 101


@pytest.mark.parametrize(
    ("read", "path", "text", "message"),
    [
        (Arm.from_urdf, "a.xml", MJCF, r"expected <robot>, got <mujoco> \(Arm.from_mjcf reads it"),
        (
            Arm.from_mjcf,
            "a",
            "<robot/>",
            r"expected <mujoco>, got <robot> \(Arm.from_urdf reads it",
        ),
        (Arm.from_file, "a.xml", "<html/>", "expected <robot> or <mujoco>, got <html>"),
        (Arm.from_file, "a.xml", DEEP, "most 100 elements within one another, got more around <a>"),
        (Arm.from_urdf, "binary.urdf", None, "expected well-formed XML"),
        (Arm.from_urdf, "none.urdf", None, r"none\.urdf: expected a URDF file, got none"),
        (Arm.from_urdf, ".", None, "expected a URDF file, got a folder"),
        (Arm.from_urdf, f"{LONG}.urdf", None, "cannot be read: File name too long"),
        (Arm.from_urdf, "a\0b.urdf", None, "expected a URDF file, got none"),
        (Arm.from_file, "none.urdf", None, "expected a URDF or MJCF file, got none"),
    ],
)
def test_what_is_no_robots_file_is_one_line(tmp_path, monkeypatch, read, path, text, message):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "binary.urdf").write_bytes(b"\xff\xfe\x00robot")
    if text is not None:
        write(tmp_path, text, path)
    with pytest.raises(ArmError, match=message) as caught:
        read(path)
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


# ---------------------------------------------------------------------- what cannot be

MANY = 8_000


def one_joint(tip, extra=LIMIT, **kind):
    return robot(link("base"), tip, joint("j", "base", "tip", extra=extra, **kind))


#: Point masses only: with none on link 1 the straight arm has no inertia across.
ELBOW = (link("base"), link("upper", 0, 0, com="1 0 0"), link("fore", 1, 0, com="1 0 0"),
         joint("j", "base", "upper"), joint("k", "upper", "fore").replace("0.3", "1"))  # fmt: skip
REFUSED = {
    # In the words of urdfdom.
    "no limits": (one_joint(link("tip"), ""), r"Joint \[j\] is of type REVOLUTE but it does not"),
    "no name": ("<robot/>", "No name given for the robot"),
    "not a number": (
        one_joint(link("tip", "heavy")),
        r"mass \[heavy\] is not a float; Could not parse inertial element for Link \[tip\]"),
    # In ours: what those let pass.
    "floating": (
        robot(link("w"), link("base"), link("tip"), joint("j", "base", "tip"),
              joint("root", "w", "base", "floating", "")),
        r"joint 'root': expected revolute, .* got a free joint, .* is fixed \(keep = .tip.\)$"),
    "planar": (one_joint(link("tip"), "", kind="planar"), "prismatic, got a planar joint"),
    "no axis": (one_joint(link("tip"), axis="0 0 0"), "joint 'j': expected axis a unit vector"),
    "no joints": (robot(link("x")), "expected at least one joint that is free"),
    "broken XML": ("<robot name='x'><link></robot>", "expected well-formed XML, got mismatched"),
    "massless tip": (
        robot(link("base"), link("a"), link("tip", 0, 0), joint("j", "base", "a"),
              joint("k", "a", "tip")),
        "positive definite mass matrix.*link 'tip' .*joint 'k'.*links without mass: 1 of 2; the"),
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


# ---------------------------------------------------------------------- robot_descriptions


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A robot_descriptions that has its robots on this disk."""
    folder = tmp_path / "site" / "robot_descriptions"
    folder.mkdir(parents=True)
    (folder / "__init__.py").touch()
    urdf = write(tmp_path, TWO_LINK, "two.urdf")
    mjcf = write(tmp_path, MJCF, "lifter.xml")
    modules = {
        "two_description": f"URDF_PATH = {str(urdf)!r}\nPACKAGE_PATH = {str(tmp_path)!r}\n",
        "lifter_mj_description": f"MJCF_PATH = {str(mjcf)!r}\n",
        "far_description": "raise OSError('no network\\nat all')\n",
        "empty_description": "",
        "macro_description": f"XACRO_PATH = 'x'\nPACKAGE_PATH = {str(tmp_path)!r}\n",
        "bad_macro_description": "XACRO_PATH = ''\n",
        "_xacro": (
            f"def get_urdf_path(module):\n    if module.XACRO_PATH:\n        return {str(urdf)!r}\n"
            "    raise ModuleNotFoundError('Install it with `pip install xacrodoc`.')\n"
        ),
    }
    for name, code in modules.items():
        (folder / f"{name}.py").write_text(code, encoding="utf-8")
    monkeypatch.syspath_prepend(str(folder.parent))
    yield folder
    for name in [name for name in sys.modules if name.startswith("robot_descriptions")]:
        del sys.modules[name]


def test_a_description_is_read_whichever_file_it_has(package, tmp_path):
    arm = Arm.from_description("two_description", gravity=9.8)
    two = Arm.two_link()
    assert np.array_equal(arm.mass_matrix([0.1, 0.2]), two.mass_matrix([0.1, 0.2]))
    assert Arm.from_description("macro_description").n == 2
    lifter = Arm.from_description("lifter_mj_description", lock={"slide": 0.1})
    assert lifter == Arm.from_mjcf(tmp_path / "lifter.xml", {"slide": 0.1})


def test_what_is_saved_needs_neither_package_nor_network(package, tmp_path, monkeypatch):
    table = {"kind": "description", "name": "two_description"}
    arm = descriptions.from_dict(table, Arm)
    saved = descriptions.to_dict(arm)
    (tmp_path / "two.urdf").unlink()
    with monkeypatch.context() as hidden:  # which would else come back after the fixture's end
        hidden.setitem(sys.modules, "robot_descriptions", None)
        assert descriptions.from_dict(saved, Arm) == arm


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("too_description", "description: expected one of .*did you mean two_description"),
        ("two", r"did you mean two_description\?"),
        ("TWO_description", r"did you mean two_description\?"),
        ("Lifter", r"did you mean lifter_mj_description\?"),
        ("bad_macro_description", "xacro cannot write it out: Install it with `pip install xacro"),
        ("far_description", "far_description: cannot be downloaded: no network at all"),
        ("empty_description", "expected a description with a URDF or an MJCF file, got neither"),
    ],
)
def test_what_is_no_description_is_refused_on_one_line(package, name, message):
    with pytest.raises((ArgumentError, ArmError), match=message) as caught:
        Arm.from_description(name)
    assert "\n" not in str(caught.value)


def test_the_command_line_suggests_names_of_the_package_too(package, capsys):
    assert main(["inspect", "Lifter"]) == 2
    assert "got 'Lifter' (did you mean lifter_mj_description?)" in capsys.readouterr().err
