"""One step of motion, and the ends that it finds."""

import numpy as np
import pytest

from fpid_pin.kernels import motion

pytestmark = pytest.mark.kernels


def plants(runs, n, **values):
    found = np.zeros((runs, n), motion.PLANT)
    for name, value in values.items():
        found[name] = value
    return found


def test_a_drive_clips_brakes_and_is_recorded():
    mine = plants(2, 2, limit=[5.0, np.inf], viscous=0.5, push=[[0.0, 1.0], [0.0, 0.0]],
                  disturbance=[[2], [0]])  # fmt: skip
    x, torque = np.random.default_rng(0).normal(size=(2, 2, 2)) * 10.0, np.zeros((2, 2))
    torque[0] = [9.0, -7.0]
    forces = np.arange(24.0).reshape(4, 3, 2)
    rows, tau = np.zeros((3, 4, 2, 2)), np.zeros((2, 2))
    alive = np.array([True, False])
    assert not motion.drive(alive, mine, torque, x, forces, 2, rows, tau)
    assert rows[2, 2].tolist() == [[5.0, -7.0], [0.0, 0.0]]
    assert (rows[:2, 2] == x).all()
    assert tau[0] == pytest.approx([5.0, -6.0] - 0.5 * x[1, 0] + forces[2, 2], rel=1e-14)
    torque[0, 1] = np.nan
    assert motion.drive(alive, mine, torque, x, forces, 2, rows, tau)


def test_an_infinite_torque_is_not_hidden_by_a_limit():
    rows, x = np.zeros((3, 1, 1, 1)), np.zeros((2, 1, 1))
    torque, alive = np.full((1, 1), np.inf), np.ones(1, bool)
    forces = np.zeros((1, 1, 1))
    assert motion.drive(alive, plants(1, 1, limit=5.0), torque, x, forces, 0, rows, x[0].copy())
    assert rows[2, 0, 0, 0] == np.inf


def test_semi_implicit_euler_uses_the_new_rate():
    x, a = np.random.default_rng(1).normal(size=(2, 2, 2)), np.ones((2, 2))
    expected_v = x[1] + 0.1 * a
    expected_q = x[0] + 0.1 * expected_v
    halves = x.copy()
    motion.euler(x, a, 0.1)
    assert (x[1] == expected_v).all()
    assert (x[0] == expected_q).all()
    motion.accelerate_all(halves, a, 0.1)
    motion.coast_all(halves, 0.1)
    assert (halves == x).all()


def test_runge_kutta_integrates_a_cubic_exactly():
    """q'' = 6 t has q = t^3; its stages see t = 0, h/2, h/2, h."""
    h, x = 0.3, np.zeros((2, 1, 1))
    slopes, there, tau = np.zeros((4, 2, 1, 1)), np.zeros((2, 1, 1)), np.zeros((1, 1))
    times = np.array([0.0, h / 2, h])
    forces = 6.0 * times.reshape(3, 1, 1, 1)
    for i, (part, at) in enumerate(((0.5, 1), (0.5, 1), (1.0, 2))):
        motion.stage(x, slopes[i], np.zeros((1, 1)), plants(1, 1), forces, at, 0,
                     part * h, there, tau)  # fmt: skip
        slopes[i + 1] = there[1], tau
    motion.runge_kutta(x, slopes, h)
    assert x[1, 0, 0] == pytest.approx(3.0 * h**2, rel=1e-14)
    assert x[0, 0, 0] == pytest.approx(h**3, rel=1e-14)


def test_a_stage_brakes_by_its_own_rate():
    x, tau, out = np.ones((2, 1, 1)), np.full((1, 1), 10.0), np.zeros((1, 1))
    slope, there = np.full((2, 1, 1), 2.0), np.zeros((2, 1, 1))
    motion.stage(x, slope, tau, plants(1, 1, viscous=3.0), np.zeros((3, 1, 1, 1)), 1, 0,
                 0.5, there, out)  # fmt: skip
    assert (there == 2.0).all()
    assert out == pytest.approx(10.0 - 3.0 * (2.0 - 1.0))


def test_arrivals_are_looked_at_and_shown_the_reference():
    references = np.arange(24.0).reshape(3, 2, 2, 2)
    seen, x, alive = np.zeros((5, 2, 2)), np.zeros((2, 2, 2)), np.array([True, True])
    own = plants(2, 2, runaway=10.0, reference=[[1], [0]])
    assert not motion.arrive(alive, own, x, references, 1, seen)
    assert (seen[2:] == references[:, 1, [1, 0]]).all()
    for part, value in ((1, 10.1), (1, np.nan), (0, np.inf)):
        x[part, 1, 0] = value
        assert motion.arrive(alive, own, x, references, 0, seen)
        alive[1] = False
        assert not motion.arrive(alive, own, x, references, 0, seen)
        alive[1], x[part, 1, 0] = True, 0.0
