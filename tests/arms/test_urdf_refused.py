"""Robots that cannot be, or that would stop the process: one line each, and no long wait."""

import contextlib
import time

import pytest
from test_from_urdf import LIMIT, MESH, joint, link, robot, write

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning

MANY = 8_000


def body(name, diagonal, off=(0, 0, 0), mass=1.0):
    keys = zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), (*diagonal, *off), strict=True)
    entries = " ".join(f'{key}="{value}"' for key, value in keys)
    inertial = f'<inertial><mass value="{mass}"/><inertia {entries}/></inertial>'
    return f'<link name="{name}">{inertial}</link>'


def one_joint(tip, extra=LIMIT):
    return robot(link("base"), tip, joint("j", "base", "tip", extra=extra))


REFUSED = {
    "negative mass": (one_joint(link("tip", -1.0)), r"link 'tip': expected a mass >= 0 .*got -1"),
    "negative moment": (
        one_joint(body("tip", (-0.1, 0.2, 0.2))),
        r"link 'tip': expected principal moments of inertia >= 0 .*got -0\.1, 0\.2, 0\.2",
    ),
    "triangle inequality": (
        one_joint(body("tip", (0.1, 0.1, 0.3))),
        r"none above the sum of the others, got 0\.1, 0\.1, 0\.3",
    ),
    "negative damping": (
        one_joint(link("tip"), LIMIT + '<dynamics damping="-0.5"/>'),
        "joint 'j': <dynamics>: expected damping >= 0, got -0.5",
    ),
    "detached cycle": (
        robot(
            *map(link, ("base", "tip", "x", "y")),
            joint("j", "base", "tip"), joint("k", "x", "y"), joint("l", "y", "x"),
        ),
        "expected every link below the base 'base', got 2 in a cycle: 'x', 'y'",
    ),
    "two inertias": (
        one_joint(link("tip").replace("</inertial>", "</inertial><inertial/>")),
        "link 'tip': expected one <inertial>, got 2",
    ),
    "elements within elements": (
        f"<robot>{'<a>' * 101}{'</a>' * 101}</robot>",
        "expected at most 100 elements within one another, got more around <a>",
    ),
    "an entity that grows": (
        '<!DOCTYPE r [<!ENTITY a "' + "ha" * 500 + '">'
        + "".join(f'<!ENTITY {b} "{f"&{a};" * 100}">' for a, b in ("ab", "bc", "cd", "de"))
        + "]><robot>&e;</robot>",
        "expected well-formed XML, got limit on input amplification",
    ),
    "another file": (
        '<!DOCTYPE r [<!ENTITY a SYSTEM "file:///etc/hostname">]><robot>&a;</robot>',
        "expected well-formed XML, got undefined entity",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("text", "message"), REFUSED.values(), ids=REFUSED)
def test_what_cannot_be_is_refused_on_one_line(text, message, capfd):
    with pytest.raises(ArmError, match=message) as caught:
        descriptions.from_dict({"kind": "urdf", "urdf": text}, Arm)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("diagonal", [(0, 0.1, 0.1), (0.1, 0.2, 0.302), (0, 0, 0)])
def test_rods_plates_points_and_rounded_numbers_are_bodies(diagonal):
    tip = body("tip", diagonal).replace("<mass", '<origin xyz="0.1 0 0"/><mass')
    table = {"kind": "urdf", "urdf": one_joint(tip)}
    assert descriptions.from_dict(table, Arm).n == 1


def chain(n, kind="revolute", extra=LIMIT):
    links = [link(f"l{k}") for k in range(n + 1)]
    joints = [joint(f"j{k}", f"l{k}", f"l{k + 1}", kind, extra) for k in range(n)]
    return links + joints


def cycle(n):
    links = [link(f"x{k}") for k in range(n)]
    return links + [joint(f"f{k}", f"x{k}", f"x{(k + 1) % n}") for k in range(n)]


LARGE = {
    "loose": (lambda n: [link(f"l{k}") for k in range(n)], "expected one base link, got 8000"),
    "chain": (chain, "expected at most 500 joints from the base to a tip"),
    "one name": (lambda n: [link("l")] * n, r"names? of their own, got 'l' 8000 time"),
    "cycle": (lambda n: chain(1) + cycle(n), "got 8000 in a cycle: 'x0', 'x1', 'x2', ..."),
    "deep": (lambda n: chain(501, "fixed", ""), "at most 500 joints .* above link 'l501'"),
}  # fmt: skip


def work_of(path):
    """Return how much time of the processor it takes to read a file [s]."""
    began = time.process_time()
    with contextlib.suppress(ArmError):
        Arm.from_urdf(path)
    return time.process_time() - began


@pytest.mark.parametrize("name", LARGE)
def test_large_files_are_refused_in_one_short_line_and_in_proportion(name, tmp_path):
    parts, message = LARGE[name]
    (tmp_path / "small").mkdir()
    small = write(tmp_path / "small", robot(*parts(MANY // 20)))
    path = write(tmp_path, robot(*parts(MANY)))
    # Twenty times as much is twenty times the work. By lists of names it was 140 times, and a deep
    # chain ended the process.
    least, most = (min(work_of(x) for _ in range(3)) for x in (small, path))
    assert most < 75.0 * least
    with pytest.raises(ArmError, match=message) as caught:
        Arm.from_urdf(path)
    assert len(str(caught.value)) < 400
    assert "\n" not in str(caught.value)


def test_as_deep_as_may_be_is_an_arm():
    parts = [*chain(499, "fixed", ""), link("tip"), joint("j", "l499", "tip")]
    arm = descriptions.from_dict({"kind": "urdf", "urdf": robot(*parts)}, Arm)
    assert arm.tool_pose([0.0])[0, 3] == pytest.approx(500 * 0.3)


LONG = "n" * 300


def test_a_path_that_the_system_cannot_hold_is_one_line(tmp_path):
    with pytest.raises(ArmError, match="cannot be read: File name too long") as caught:
        Arm.from_urdf(tmp_path / f"{LONG}.urdf")
    assert len(str(caught.value)) < 300
    with pytest.raises(ArmError, match="expected a URDF file, got none"):
        Arm.from_urdf("a\0b.urdf")
    with pytest.raises(ArgumentError, match="path: expected the path of a URDF file, got int"):
        Arm.from_urdf(5)


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
        ({"path": 5}, "path: expected the path of a URDF file, got 5"),
        ({"path": "a\0b"}, r"path: expected the path of a URDF file, got 'a\\x00b'"),
        ({"package_dirs": 5}, "package_dirs: expected a list of folders, got int"),
    ],
)
def test_odd_paths_in_a_table_are_refused(entry, message):
    """A run's file holds them; the first two were tracebacks, one of them only when drawn."""
    table = {"kind": "urdf", "urdf": one_joint(link("tip"))}
    with pytest.raises(ArgumentError, match=message):
        descriptions.from_dict(table | entry, Arm)
