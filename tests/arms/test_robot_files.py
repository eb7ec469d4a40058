"""Which kind a robot's file is, what has to be done first, and robots that are downloaded."""

import sys
from pathlib import Path

import numpy as np
import pytest
from robots import LIFTER as MJCF
from robots import write

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError, ArmError, FpidError

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


@pytest.mark.parametrize("read", [Arm.from_file, Arm.from_urdf, Arm.from_mjcf])
def test_macros_are_refused_with_the_command_that_writes_them_out(tmp_path, read):
    path = write(tmp_path, XACRO, "my arm.urdf.xacro")
    with pytest.raises(ArmError, match=r"run: xacro '.*/my arm.urdf.xacro' > robot.urdf") as caught:
        read(path)
    assert "\n" not in str(caught.value)


def test_a_urdf_that_xacro_has_written_is_read(tmp_path):
    text = TWO_LINK.replace("<robot ", '<robot xmlns:xacro="http://ros.org/wiki/xacro" ')
    assert Arm.from_file(write(tmp_path, text, "a.urdf")).n == 2


@pytest.mark.parametrize(
    ("read", "text", "message"),
    [
        (Arm.from_urdf, MJCF, r"expected <robot>, got <mujoco> \(Arm.from_mjcf reads it"),
        (Arm.from_file, "<html/>", "expected <robot> or <mujoco>, got <html>"),
        (Arm.from_file, "links", "expected well-formed XML"),
        (Arm.from_file, "<a>" * 200 + "</a>" * 200, "expected at most 100 elements within one"),
    ],
)
def test_other_files_are_refused(tmp_path, read, text, message):
    with pytest.raises(ArmError, match=message):
        read(write(tmp_path, text, "a.xml"))


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
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
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


def test_a_missing_package_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)
    with pytest.raises(FpidError, match=r"pip install 'fpid_pin\[descriptions\]'"):
        Arm.from_description("ur5e_description")
