"""The observer's kernels on a joint that is nothing but an inertia, against closed forms."""

import numpy as np
import pytest

pytestmark = pytest.mark.kernels

STEP, OMEGA = 1e-3, 80.0
POLE = np.exp(-OMEGA * STEP)


def records():
    """Return the records of three runs: one observes, one has none, one has ended."""
    from fpid_pin.kernels import law

    robots, joints = np.zeros(3, law.ROBOT), np.zeros((3, 1), law.JOINT)
    robots["h"] = STEP
    robots["l1"], robots["l2"] = 1.0 - POLE**2, (1.0 - POLE) ** 2 / STEP
    robots["l1"][1] = robots["l2"][1] = 0.0
    joints["limit"] = np.inf
    return robots, joints, np.array([True, True, False])


def test_what_accelerates_without_a_cause_is_found_by_its_closed_form():
    from fpid_pin.kernels import observer

    robots, joints, alive = records()
    lost = 3.0  # [rad/s^2]
    v, v_hat, xi, a, change = np.zeros((5, 3, 1))
    for k in range(200):
        v[:] = lost * STEP * k
        observer.correct(alive, robots, joints, v, v_hat, xi)
        part = 1.0 - POLE**k * (1.0 + (1.0 - POLE) * k)
        assert xi[:, 0] == pytest.approx([lost * part, 0.0, 0.0], abs=1e-11)
        assert v_hat[1] == v[1]
        observer.predict(robots, joints, a, change)
    assert v_hat[0] == pytest.approx(v[0], abs=1e-4)
    assert robots["observing"].tolist() == [1, 1, 0]
    assert xi[0, 0] == pytest.approx(lost, rel=1e-4)


def test_a_tick_of_nobody_is_not_a_beginning():
    # What the model makes of angles 0 must not be what the first measurement is compared with.
    from fpid_pin.kernels import observer

    robots, joints, alive = records()
    v, v_hat, xi, change = np.zeros((4, 3, 1))
    observer.correct(np.zeros_like(alive), robots, joints, v, v_hat, xi)
    observer.predict(robots, joints, np.full((3, 1), -9.81), change)
    v[:] = 2.0
    observer.correct(alive, robots, joints, v, v_hat, xi)
    assert (xi == 0.0).all()
    assert v_hat[:2, 0].tolist() == [2.0, 2.0]


def test_the_prediction_is_a_step_of_the_model_and_of_all_that_is_added():
    from fpid_pin.kernels import observer

    robots, joints, _ = records()
    joints["v_hat"], joints["xi"] = 1.0, 4.0
    observer.predict(robots, joints, np.full((3, 1), 10.0), np.full((3, 1), -2.0))
    assert joints["predicted"] == pytest.approx(np.full((3, 1), 1.0 + STEP * 12.0))


def test_the_model_s_torque_is_added_cut_and_noted():
    from fpid_pin.kernels import observer

    _, joints, alive = records()
    joints["u_fpid"], joints["limit"] = 4.0, [[10.0], [3.0], [10.0]]
    torque = np.full((3, 1), 7.0)
    observer.compensate(alive, joints, np.full((3, 1), 5.0), np.full((3, 1), 3.5), torque)
    assert torque[:, 0].tolist() == [5.5, 3.0, 7.0]
    assert joints["u_m"][:, 0].tolist() == [1.5, 1.5, 0.0]
    assert joints["cut"][:, 0].tolist() == [0.0, 2.5, 0.0]


def test_what_moves_the_model_is_the_torque_less_its_viscous_friction():
    from fpid_pin.kernels import observer

    _, joints, _ = records()
    joints["viscous"] = 0.5
    tau = np.zeros((3, 1))
    observer.brake(joints, np.full((3, 1), 2.0), np.full((3, 1), 3.0), tau)
    assert (tau == 0.5).all()
