import dataclasses
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import Gene, Space

CONTROLLER = fp.paper_controller(supervised=False)
MIXED = Space(
    integral_order=(0, 1),
    derivative_order=(0.5, 1, "shared"),
    kp=(1, 100, "log"),
    ki=Gene((1, 2), (10, 40), "log"),
    learning_rate=(0, 50, "shared"),
)


def test_a_coordinate_for_each_joint_and_one_where_shared():
    bound = MIXED.bind(CONTROLLER, 2)
    assert bound.labels == (
        "integral_order.0", "integral_order.1", "derivative_order", "kp.0", "kp.1", "ki.0",
        "ki.1", "learning_rate",
    )  # fmt: skip


@given(st.lists(st.floats(0, 1), min_size=8, max_size=8))
def test_every_point_gives_a_controller_within_the_bounds(point):
    bound = MIXED.bind(CONTROLLER, 2)
    values = bound.values(np.array(point))
    assert (bound.low <= values).all()
    assert (values <= bound.high).all()
    law = bound.controller(values)
    assert np.array_equal(law.kp, values[3:5])
    assert float(law.learning_rate) == values[7]
    assert np.array_equal(law.kd, CONTROLLER.kd)
    # And it is found again where it lies.
    np.testing.assert_allclose(bound.point(law), point, atol=1e-12)


def test_the_middle_of_a_logarithmic_scale_is_the_geometric_mean():
    bound = Space(kp=(1, 100, "log"), ki=(1, 100)).bind(CONTROLLER, 2)
    np.testing.assert_allclose(bound.values(np.full(4, 0.5)), [10, 10, 50.5, 50.5], rtol=1e-14)


def test_it_shows_itself_as_it_is_written_and_a_table_says_the_same():
    text = "Space(integral_order=(0, 1), kp=(1, 9, 'log', 'shared'))"
    assert repr(eval(text)) == text
    table = {"integral_order": [0, 1], "kp": {"low": 1, "high": 9, "scale": "log", "shared": True}}
    assert Space(**table).to_dict() == eval(text).to_dict()


@pytest.mark.parametrize(
    ("genes", "said"),
    [
        ({}, "space: expected at least one parameter, got none"),
        ({"kp": (1, 1)}, "space.kp.high: expected more than low (1), got 1"),
        ({"kp": (0, 1, "log")}, "space.kp.low: expected a number > 0, got 0"),
        ({"kp": (0, 1, "logs")}, "did you mean log?"),
        ({"kp": 3}, "space.kp: expected bounds (low, high)"),
        ({"kp": {"low": 1, "high": 2, "scael": "log"}}, "did you mean scale?"),
        ({"kp": ((1, 2), (3, 4, 5))}, "space.kp.high: expected one length for all joints"),
        ({"intgral_order": (0, 1)}, "did you mean integral_order?"),
        ({"integral_order": (0, 1.5)}, "space.integral_order.high: expected a number in [0, 1]"),
        ({"kp": ((1, 2, 3), 9)}, "space.kp.low: expected shape (2,)"),
        ({"kp": ((1, 2), 9, "shared")}, "space.kp.low: expected a number, got shape (2,)"),
        ({"observer": (1, 9)}, 'space.observer: expected "shared" behind its bounds'),
    ],
)  # fmt: skip
def test_what_is_wrong_with_bounds_or_refused_by_the_controller_is_named(genes, said):
    with pytest.raises(ArgumentError, match=re.escape(said)):
        Space(**genes).bind(CONTROLLER, 2)


def test_a_start_outside_the_space_is_refused():
    bound = Space(kp=(1, 11)).bind(CONTROLLER, 2)
    with pytest.raises(ArgumentError, match="initial.kp: expected within"):
        bound.point(CONTROLLER)
    shared = Space(kp=(1, 100, "shared")).bind(CONTROLLER, 2)
    with pytest.raises(ArgumentError, match="initial.kp: expected one value for all joints"):
        shared.point(CONTROLLER)
    assert shared.point(dataclasses.replace(CONTROLLER, kp=50.5)) == pytest.approx([0.5])
