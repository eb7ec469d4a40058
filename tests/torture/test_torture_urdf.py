"""URDFs by grammar, and a sound one spoilt: an arm or one line, never a traceback or a crash.

`FPID_TORTURE=full` tries 8,000 in place of 80.
"""

import contextlib
import os
import warnings

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import FpidError, FpidWarning

pytestmark = pytest.mark.torture
FULL = os.environ.get("FPID_TORTURE") == "full"
SIZES = settings(max_examples=4000 if FULL else 40, suppress_health_check=list(HealthCheck))

SOUND = """<?xml version="1.0"?>
<robot name="sound"><material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
<link name="base"/>
<link name="upper"><inertial><origin xyz="0.2 0 0" rpy="0 0 0"/><mass value="2"/>
<inertia ixx="0.02" iyy="0.03" izz="0.03" ixy="0.001" ixz="0" iyz="0"/></inertial>
<visual><geometry><cylinder radius="0.05" length="0.4"/></geometry>
<material name="grey"/></visual>
<collision><geometry><box size="0.1 0.1 0.4"/></geometry></collision></link>
<link name="fore"><inertial><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.002" ixy="0" ixz="0" iyz="0"/></inertial>
<visual><geometry><mesh filename="package://a/b.stl" scale="1 1 1"/></geometry></visual></link>
<link name="tool"/>
<joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
<origin xyz="0 0 0.3" rpy="0 0 1.57"/><axis xyz="0 1 0"/>
<limit lower="-2" upper="2" effort="50" velocity="3"/>
<dynamics damping="0.5" friction="0.1"/></joint>
<joint name="elbow" type="continuous"><parent link="upper"/><child link="fore"/>
<origin xyz="0.4 0 0"/><axis xyz="0 0 1"/><limit effort="20" velocity="3"/></joint>
<joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/></joint>
</robot>"""

HOSTILE = st.one_of(
    st.sampled_from(["0", "1", "0.1", "-0.1", "1e308", "-1e308", "5e-324", "1e999", "nan", "inf"]),
    st.sampled_from(["", " ", "1 2", "0x10", "1_0", "1,5", "१", "--1", "1e", ".", "a" * 300]),
)
ODD_NAMES = st.one_of(
    st.sampled_from(["universe", "root_joint", "", " ", "n" * 5000, "a:b", "../..", "$x$"]),
    st.text(st.characters(codec="utf-8"), max_size=6),
)


def mostly(usual, odd):
    """Draw what is usual, and one time in forty what is not (hypothesis prefers the ends)."""
    return st.integers(0, 39).flatmap(lambda k: odd if k == 17 else usual)


NAMES = mostly(st.sampled_from("abcdefgh"), ODD_NAMES)
NUMBERS = mostly(st.floats(-10.0, 10.0).map(repr), HOSTILE)
POSITIVE = mostly(st.floats(0.1, 2.0).map(repr), HOSTILE)
MOMENTS = mostly(st.floats(1.0, 2.0).map(repr), HOSTILE)
KINDS = st.sampled_from(
    ["revolute", "continuous"] * 8 + ["fixed", "prismatic", "floating", "planar", "", "spherical"]
)


def quoted(text):
    """Write an attribute's value; what no XML holds, not even as a reference, is left out."""
    kept = (c for c in text if c in "\t\n\r" or (ord(c) >= 32 and c not in "\ufffe\uffff"))
    signs = {"&": "&amp;", "<": "&lt;", '"': "&quot;", "\n": "&#10;", "\r": "&#13;", "\t": "&#9;"}
    return '"' + "".join(signs.get(c, c) for c in kept) + '"'


def vector(numbers):
    return mostly(st.tuples(*[numbers] * 3), st.lists(numbers, max_size=5)).map(" ".join)


NOTHING = st.just("")


@st.composite
def element(draw, tag, attributes, inside=NOTHING):
    """Draw an element; now and then an attribute or all of it is missing, or it is there twice."""
    kept = {k: draw(v) for k, v in attributes.items() if draw(st.integers(0, 99)) != 57}
    text = f"<{tag} {' '.join(f'{k}={quoted(v)}' for k, v in kept.items())}>{draw(inside)}</{tag}>"
    return text * draw(mostly(st.just(1), st.integers(0, 2)))


def several(*parts):
    return st.tuples(*parts).map("".join)


ORIGIN = element("origin", {"xyz": vector(NUMBERS), "rpy": vector(NUMBERS)})
INERTIAL = element("inertial", {}, several(
    ORIGIN,
    element("mass", {"value": POSITIVE}),
    element("inertia", dict.fromkeys(("ixx", "iyy", "izz"), MOMENTS)
            | dict.fromkeys(("ixy", "ixz", "iyz"), mostly(st.just("0"), NUMBERS))),
))  # fmt: skip
SHAPES = st.one_of(
    element("sphere", {"radius": POSITIVE}),
    element("box", {"size": vector(POSITIVE)}),
    element("cylinder", {"radius": POSITIVE, "length": POSITIVE}),
    element("mesh", {"filename": NAMES, "scale": vector(POSITIVE)}),
)
VISUAL = element("visual", {"name": NAMES}, several(ORIGIN, element("geometry", {}, SHAPES)))
JUNK = mostly(NOTHING, st.sampled_from(["<!-- -->", "text", "<gazebo/>", "<![CDATA[<a>]]>", "<a>"]))


@st.composite
def robots(draw):
    """Draw robots: mostly chains, of which a few parts are odd."""
    names = draw(st.lists(NAMES, min_size=2, max_size=5, unique=True))
    parts = []
    for k, name in enumerate(names):
        body = several(mostly(INERTIAL, NOTHING), mostly(NOTHING, VISUAL))
        parts.append(draw(element("link", {"name": st.just(name)}, body)))
        if k:
            ends = {
                end: mostly(st.just(usual), st.sampled_from(names))
                for end, usual in (("parent", names[k - 1]), ("child", name))
            }
            inside = several(
                *(element(end, {"link": ends[end]}) for end in ends),
                ORIGIN,
                element("axis", {"xyz": vector(NUMBERS)}),
                element(
                    "limit",
                    dict.fromkeys(("lower", "upper"), NUMBERS)
                    | dict.fromkeys(("effort", "velocity"), POSITIVE),
                ),
                element("dynamics", dict.fromkeys(("damping", "friction"), POSITIVE)),
            )
            parts.append(draw(element("joint", {"name": st.just(f"j{k}"), "type": KINDS}, inside)))
        parts.append(draw(JUNK))
    return f"<robot name={quoted(draw(NAMES))}>{''.join(parts)}</robot>"


@st.composite
def spoilt(draw):
    """Draw what becomes of a sound file when pieces of it are lost, doubled or exchanged."""
    text = SOUND
    for _ in range(draw(st.integers(1, 4))):
        first, stop = sorted(draw(st.integers(0, len(text))) for _ in range(2))
        stop = min(stop, first + draw(st.sampled_from([1, 5, 60, len(text)])))
        piece = draw(st.one_of(st.just(""), st.just(text[first:stop] * 2), NUMBERS, NAMES))
        text = text[:first] + piece + text[stop:]
    return text


def arm_or_one_line(text, lock):
    """Build the arm, use it and draw it; what is refused is refused on one line."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", FpidWarning)
            arm = descriptions.from_dict({"kind": "urdf", "urdf": text, "lock": lock}, Arm)
    except FpidError as error:
        return str(error)
    assert np.isfinite(arm.mass_matrix(arm.home)).all()
    assert (np.linalg.eigvalsh(arm.mass_matrix(arm.home)) > 0.0).all()
    assert (arm.viscous_friction >= 0.0).all()
    assert (arm.dry_friction >= 0.0).all()
    assert (arm.lower <= arm.upper).all()
    with warnings.catch_warnings(), contextlib.suppress(FpidError):
        warnings.simplefilter("ignore", FpidWarning)
        arm.visual()
    return ""


@SIZES
@given(robots(), mostly(st.just({}), st.just({"j1": 0.0})))
def test_robots_by_grammar(text, lock):
    said = arm_or_one_line(text, lock)
    assert "\n" not in said
    assert len(said) < 1000


@SIZES
@given(spoilt())
def test_a_sound_robot_spoilt(text):
    said = arm_or_one_line(text, {})
    assert "\n" not in said
    assert len(said) < 1000


def test_the_sound_robot_is_an_arm():
    """Else the test above would spoil what no one takes anyway."""
    assert arm_or_one_line(SOUND, {}) == ""
