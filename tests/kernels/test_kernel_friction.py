"""Dry friction's box problem: its conditions hold, whatever the guess."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpid_pin.kernels import friction

pytestmark = pytest.mark.kernels


def solved(response, dry, v_free, guess):
    n = len(dry)
    stuck, force, speed = guess.copy(), np.zeros(n), np.zeros(n)
    friction.stick_slip(
        response, dry, v_free, stuck, force, speed,
        np.zeros(n), np.zeros(n), np.zeros((n, n)),
    )  # fmt: skip
    return stuck, force, speed


@settings(max_examples=60)
@given(st.integers(1, 6), st.integers(0, 10**6))
def test_the_conditions_of_the_box_problem_hold(n, seed):
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(n, n))
    response = root @ root.T + 0.05 * np.eye(n)
    dry = rng.uniform(0.0, 2.0, n) * rng.integers(0, 2, n)
    v_free = rng.normal(size=n) * rng.choice([0.1, 3.0])
    stuck, force, speed = solved(response, dry, v_free, rng.integers(0, 2, n).astype(bool))
    assert speed == pytest.approx(np.where(stuck, 0.0, v_free - response @ force), abs=1e-9)
    # What sticks has exactly no speed, up to the friction that it needs.
    assert (v_free - response @ force)[stuck] == pytest.approx(0.0, abs=1e-9)
    assert (speed[stuck] == 0.0).all()
    assert (np.abs(force) <= dry).all()
    slides = ~stuck & (dry > 0.0) & (speed != 0.0)
    assert force[slides] == pytest.approx((dry * np.sign(speed))[slides])
    assert (force * speed >= 0.0).all()


def test_it_ends_where_the_block_rounds_go_in_circles(monkeypatch):
    """Three joints so coupled that exchanging all at fault cycles, as Murty's matrix does."""
    n = 7
    upper = 2.0 * np.triu(np.ones((n, n)), 1) + np.eye(n)
    response = upper @ upper.T
    rng = np.random.default_rng(0)
    for _ in range(60):
        v_free = response @ rng.normal(size=n) * rng.choice([0.5, 1.0, 2.0])
        stuck, force, speed = solved(response, np.ones(n), v_free, rng.integers(0, 2, n) > 0)
        assert (np.abs(force) <= 1.0).all()
        assert (force * speed >= -1e-12).all()
        assert (v_free - response @ force)[stuck] == pytest.approx(0.0, abs=1e-7)


def test_joints_that_slide_on_need_no_solving():
    dry, v = np.array([[1.0, 0.0], [1.0, 1.0]]), np.array([[2.0, -0.5], [1e-3, -2.0]])
    force, alive = np.zeros((2, 2)), np.array([True, True])
    friction.slide(alive, dry, v, force)
    assert force.tolist() == [[1.0, 0.0], [1.0, -1.0]]
    speed, stuck, turns = force / 2.0, np.zeros((2, 2), bool), np.zeros(2, bool)
    assert friction.keeps_sliding(dry, v, speed, stuck, 0.1, turns)
    assert turns.tolist() == [False, True]
    assert stuck.tolist() == [[False, False], [True, False]]
    assert speed[0] == pytest.approx([2.0 - 0.05, -0.5])
    alive[1] = False
    friction.slide(alive, dry, v, force)
    assert (force[1] == 0.0).all()


def test_a_robot_at_rest_stays_where_friction_bears_its_momentum():
    dry, h = np.ones((3, 2)), 0.1
    hold = np.array([[0.05, -0.09], [0.05, 0.2], [0.0, 0.0]])
    stuck, turns = np.ones((3, 2), bool), np.array([True, True, False])
    force, speed = np.zeros((3, 2)), np.full((3, 2), 7.0)
    assert friction.rests(dry, hold, stuck, force, speed, turns, h)
    assert turns.tolist() == [False, True, False]
    assert force[0] == pytest.approx([0.5, -0.9])
    assert (speed[0] == 0.0).all()
    assert (speed[1:] == 7.0).all()


def test_a_speed_that_is_rounding_of_zero_is_zero():
    one = np.ones((1, 1))
    for v_free in (1.0 - 1e-13, 1.0, 0.0):
        _, force, speed = solved(one, np.ones(1), np.array([v_free]), np.zeros(1, bool))
        assert speed[0] == 0.0
        assert force[0] == pytest.approx(v_free, abs=1e-12)
