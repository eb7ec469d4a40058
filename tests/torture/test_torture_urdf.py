"""A sound URDF spoilt: an arm or one line, never a traceback or a crash.

`FPID_TORTURE=full` tries 8,000 in place of 80.
"""

import contextlib
import re
import warnings

import numpy as np
import pytest
from bounded import FULL
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from robots import LIMIT, joint, link, robot

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import FpidError, FpidWarning

pytestmark = pytest.mark.torture
SIZES = settings(max_examples=8000 if FULL else 80, suppress_health_check=list(HealthCheck))

SHAPES = [
    f"<{kind}><geometry>{shape}</geometry></{kind}>"
    for kind, shape in (
        ("visual", '<cylinder radius="0.05" length="0.4"/>'),
        ("collision", '<box size="0.1 0.1 0.4"/>'),
        ("visual", '<mesh filename="package://a/b.stl" scale="1 1 1"/>'),
    )
]
SOUND = robot(
    '<material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>', link("base"),
    link("upper", 2, (0.02, 0.03, 0.03), "".join(SHAPES[:2]), "0.2 0 0"),
    link("fore", 1, (0.01, 0.01, 0.002), SHAPES[2]), '<link name="tool"/>',
    joint("shoulder", "base", "upper", extra=f'{LIMIT}<dynamics damping="0.5" friction="0.1"/>'),
    joint("elbow", "upper", "fore", "continuous", '<limit effort="20" velocity="3"/>', "0 0 1"),
    joint("flange", "fore", "tool", "fixed", ""),
)  # fmt: skip

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


@st.composite
def spoilt(draw):
    """Draw what becomes of a sound file: values, elements, or any pieces are lost or exchanged."""
    text = SOUND
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from([r'(?<==")[^"]*', r"<\w+[^<]*/>", r"<(\w+)[^<]*>.*?</\1>", ""]))
        places = [match.span() for match in re.finditer(kind, text, re.DOTALL)]
        if not places:
            continue
        first, stop = draw(st.sampled_from(places))
        if not kind:
            stop = min(first + draw(st.sampled_from([1, 5, 60])), len(text))
        exchanged = [st.just(""), NUMBERS, NAMES, HOSTILE, ODD_NAMES]
        piece = draw(st.one_of(st.just(text[first:stop] * 2), *exchanged))
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
@given(spoilt(), mostly(st.just({}), st.just({"elbow": 0.0})))
def test_a_sound_robot_spoilt(tally, text, lock):
    tally("spoilt URDFs")
    assert arm_or_one_line(SOUND, {}) == ""
    said = arm_or_one_line(text, lock)
    assert "\n" not in said
    assert len(said) <= 1000
