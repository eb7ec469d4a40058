"""One step of motion, and the ends that it finds."""

import numpy as np
import pytest

from fpid_pin.kernels import motion

pytestmark = pytest.mark.kernels


def test_a_drive_clips_brakes_and_is_recorded():
    drives = np.zeros((2, 2), motion.DRIVE)
    drives["limit"], drives["viscous"], drives["push"] = (
        [5.0, np.inf],
        0.5,
        [[0.0, 1.0], [0.0, 0.0]],
    )
    q, v, torque = np.random.default_rng(0).normal(size=(3, 2, 2)) * 10.0
    torque[0] = [9.0, -7.0]
    rows, tau = np.zeros((3, 4, 2, 2)), np.zeros((2, 2))
    alive = np.array([True, False])
    assert not motion.drive(alive, drives, torque, q, v, 2, rows, tau)
    assert rows[2, 2].tolist() == [[5.0, -7.0], [0.0, 0.0]]
    assert (rows[0, 2] == q).all()
    assert (rows[1, 2] == v).all()
    assert tau[0] == pytest.approx([5.0 - 0.5 * v[0, 0], -6.0 - 0.5 * v[0, 1]], rel=1e-14)
    torque[0, 1] = np.nan
    assert motion.drive(alive, drives, torque, q, v, 2, rows, tau)


def test_an_infinite_torque_is_not_hidden_by_a_limit():
    drives = np.zeros((1, 1), motion.DRIVE)
    drives["limit"] = 5.0
    rows, tau = np.zeros((3, 1, 1, 1)), np.zeros((1, 1))
    torque = np.full((1, 1), np.inf)
    assert motion.drive(np.ones(1, bool), drives, torque, tau, tau, 0, rows, tau)


def test_runs_share_the_disturbance_of_their_group():
    forces = np.arange(12.0).reshape(2, 3, 2)
    tau, total = np.ones((3, 2)), np.zeros((3, 2))
    motion.disturb(tau, forces, np.array([2, 0, 2]), 1, total)
    assert (total == 1.0 + forces[1, [2, 0, 2]]).all()


def test_semi_implicit_euler_uses_the_new_rate():
    q, v, a = np.random.default_rng(1).normal(size=(3, 2, 2))
    expected_v = v + 0.1 * a
    expected_q = q + 0.1 * expected_v
    halves = q.copy(), v.copy()
    motion.euler(q, v, a, 0.1)
    assert (v == expected_v).all()
    assert (q == expected_q).all()
    motion.accelerate_all(halves[1], a, 0.1)
    motion.coast_all(*halves, 0.1)
    assert (halves[0] == q).all()


def test_runge_kutta_integrates_a_cubic_exactly():
    """q'' = 6 t has q = t^3; its stages see t = 0, h/2, h/2, h."""
    h = 0.3
    q, v = np.zeros((2, 1, 1))
    slopes, q_next, v_next = np.zeros((2, 4, 1, 1)), *np.zeros((2, 1, 1))
    for i, (t, part) in enumerate([(0.0, 0.5), (h / 2, 0.5), (h / 2, 1.0), (h, 0.0)]):
        slopes[0, i], slopes[1, i] = v_next, 6.0 * t
        motion.stage(q, v, slopes, i, part * h, q_next, v_next)
    motion.runge_kutta(q, v, slopes, h)
    assert v[0, 0] == pytest.approx(3.0 * h**2, rel=1e-14)
    assert q[0, 0] == pytest.approx(h**3, rel=1e-14)


def test_arrivals_are_looked_at_and_shown_the_reference():
    references = np.arange(24.0).reshape(3, 2, 2, 2)
    seen, q, v = np.zeros((5, 2, 2)), np.zeros((2, 2)), np.zeros((2, 2))
    runaway, group, alive = np.array([10.0, 10.0]), np.array([1, 0]), np.array([True, True])
    assert not motion.arrive(alive, q, v, runaway, references, group, 1, seen)
    assert (seen[2:] == references[:, 1, [1, 0]]).all()
    for array, value in ((v, 10.1), (v, np.nan), (q, np.inf)):
        kept = array[1, 0]
        array[1, 0] = value
        assert motion.arrive(alive, q, v, runaway, references, group, 0, seen)
        alive[1] = False
        assert not motion.arrive(alive, q, v, runaway, references, group, 0, seen)
        alive[1], array[1, 0] = True, kept
