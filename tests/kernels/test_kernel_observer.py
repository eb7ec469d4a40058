"""The observer against its closed form; what it adds to a torque."""

from collections import deque

import numpy as np
import pytest

from fpid_pin.kernels import law, observer

pytestmark = pytest.mark.kernels
H = 2e-3


def records(omega, runs=1, n=2):
    robots, joints = np.zeros(runs, law.ROBOT), np.zeros((runs, n), law.JOINT)
    robots["h"] = H
    pole = np.exp(-np.asarray(omega) * H)
    robots["l1"], robots["l2"] = 1.0 - pole**2, (1.0 - pole) ** 2 / H
    joints["limit"] = np.inf
    return robots, joints


def observed(robots, joints, speeds, model, change=0.0):
    """Return v^ and xi at samples of the speed, (K, runs, n), and of what the model makes of it."""
    alive, shape = np.ones(len(robots), bool), joints.shape
    v_hat, xi = np.zeros((2, *shape))
    found = []
    for v, a in zip(speeds, model, strict=True):
        observer.correct(alive, robots, joints, v, v_hat, xi)
        observer.predict(robots, joints, a, np.broadcast_to(change, shape))
        found.append((v_hat.copy(), xi.copy()))
    return np.moveaxis(np.array(found), 1, 0)


def test_both_poles_are_p_and_a_constant_unknown_acceleration_is_found():
    """From xi = 0: xi_k - w = -w (1 + k (1 - p)) p^k and v - v^ = h w k p^(k + 1).

    With a double pole they are (a + b k) p^k; the first two samples give a and b.
    """
    omega, w = np.array([20.0, 150.0]), np.array([[3.0, -7.0], [0.5, 40.0]])
    robots, joints = records(omega, runs=2)
    k = np.arange(200.0)
    a = np.random.default_rng(0).normal(size=(200, 2, 2))  # what the model knows, and u_s adds
    steps = H * (a + 0.25 + w)
    speeds = np.cumsum(steps, axis=0) - steps + np.array([1.0, 2.0])
    v_hat, xi = observed(robots, joints, speeds, a, change=0.25)
    p, k = np.exp(-omega * H)[:, np.newaxis], k[:, np.newaxis, np.newaxis]
    # Sums of 200 speeds of size 1, times (1 - p)^2/h = 36/s: rounding of 1e-12.
    assert xi == pytest.approx(w - w * (1.0 + k * (1.0 - p)) * p**k, abs=1e-11)
    assert speeds - v_hat == pytest.approx(H * w * k * p ** (k + 1.0), abs=1e-13)
    assert xi[-1, 1] == pytest.approx(w[1], rel=1e-9)
    assert v_hat[-1, 1] == pytest.approx(speeds[-1, 1], rel=1e-9)


def test_it_begins_at_the_first_sample_of_a_run_that_lives():
    robots, joints = records(100.0, runs=2)
    v, v_hat, xi = np.full((2, 2), 5.0), *np.zeros((2, 2, 2))
    observer.correct(np.zeros(2, bool), robots, joints, v, v_hat, xi)  # a tick of nobody
    observer.correct(np.array([True, False]), robots, joints, v, v_hat, xi)
    assert v_hat.tolist() == [[5.0, 5.0], [0.0, 0.0]]
    assert (xi == 0.0).all()
    assert robots["observing"].tolist() == [1, 0]


def test_without_a_bandwidth_the_speed_is_what_is_measured():
    robots, joints = records(0.0)
    speeds = np.random.default_rng(1).normal(size=(5, 1, 2))
    v_hat, xi = observed(robots, joints, speeds, np.ones((5, 1, 2)))
    assert (v_hat == speeds).all()
    assert (xi == 0.0).all()


@pytest.mark.parametrize(("bandwidth", "stable"), [(1.0, True), (2.0, False)])
def test_at_1_over_h_what_is_cancelled_bears_two_samples_of_delay_and_at_2_over_h_not(
    bandwidth, stable
):
    """An acceleration w that the joint has, less xi of two samples ago; the model expects xi."""
    robots, joints = records(bandwidth / H, n=1)
    v, v_hat, xi, late = np.zeros((4, 1, 1))
    alive, past = np.array([True]), deque([0.0, 0.0, 0.0], maxlen=3)
    for _ in range(300):
        observer.correct(alive, robots, joints, v, v_hat, xi)
        past.append(xi[0, 0])
        observer.predict(robots, joints, -xi, late)
        v = v + H * (1.0 - past[0])
    assert (abs(xi[0, 0] - 1.0) < 0.01) == stable
    assert (abs(xi[0, 0]) > 1e3) != stable


def test_what_the_model_adds_is_feedforward_less_what_disturbs():
    _, joints = records(0.0, runs=2)
    joints["u_fpid"], joints["limit"] = 1.0, 4.0
    torque = np.full((2, 2), 9.0)
    alive = np.array([True, False])
    feedforward, disturbance = np.array([[3.0, 3.0]] * 2), np.array([[1.0, -2.0]] * 2)
    observer.compensate(alive, joints, feedforward, disturbance, torque)
    assert joints["u_m"].tolist() == [[2.0, 5.0], [0.0, 0.0]]
    assert torque.tolist() == [[3.0, 4.0], [9.0, 9.0]]
    assert joints["cut"].tolist() == [[0.0, 2.0], [0.0, 0.0]]


def test_friction_brakes_by_the_speed_that_is_estimated():
    _, joints = records(0.0)
    joints["viscous"] = [0.5, 2.0]
    tau = np.zeros((1, 2))
    observer.brake(joints, np.array([[1.0, 1.0]]), np.array([[2.0, -3.0]]), tau)
    assert tau.tolist() == [[0.0, 7.0]]
