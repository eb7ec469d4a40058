"""The supervisors' kernels: V, the paper's (20), the projection onto a ball, who is left alone.

That the paper's holds gains and integrals is in test_kernel_law.py, the sampled one's theorem in
tests/control/test_supervisor_theorem.py.
"""

import numpy as np
import pytest

from fpid_pin.kernels import law, supervisor

pytestmark = pytest.mark.kernels
P = np.array([[1.75, 1.0], [1.0, 1.5]])
H = 1e-2


def records(runs=1, n=2, target=0.5, lookahead=3.0 * H, **robot):
    robots, joints = np.zeros(runs, law.ROBOT), np.zeros((runs, n), law.JOINT)
    robots["p11"], robots["p12"], robots["p22"] = P[0, 0], P[0, 1], P[1, 1]
    robots["h"], robots["lookahead"], robots["target"] = H, lookahead, target
    for name, value in robot.items():
        robots[name] = value
    joints["limit"] = np.inf
    return robots, joints


def energy(e, rate):
    x = np.stack([e, rate])
    return 0.5 * np.einsum("a...,ab,b...->...", x, P, x).sum(axis=-1)


def project(robots, joints, e, v_ref=0.0, a_ref=0.0, acceleration=0.0, alive=None):
    shape = joints.shape
    inputs = np.zeros((5, *shape))
    joints["e"], inputs[3], inputs[4] = e, v_ref, a_ref
    direction = np.full(shape, np.nan)
    alive = np.ones(shape[0], bool) if alive is None else alive
    found = supervisor.project(
        alive, robots, joints, inputs, np.broadcast_to(acceleration, shape).copy(), direction
    )
    return found, direction


def test_v_is_equation_14():
    robots, _ = records()
    q, v, q_ref, v_ref = np.random.default_rng(2).normal(size=(4, 5))
    v_14 = supervisor.lyapunov(robots[0], q, v, q_ref, v_ref)
    assert v_14 == pytest.approx(energy(q_ref - q, v_ref - v), rel=1e-13)


def test_the_paper_s_torque_is_equation_20_in_the_direction_of_w():
    """Rows: sgn with G of the model, a boundary layer with G in the bound, not acting, dead."""
    robots, joints = records(runs=4, n=3, k0=0.5, k1=1.0)
    rng, alive = np.random.default_rng(3), np.array([True, True, True, False])
    robots["layer"], robots["acting"], robots["own_gravity"] = (
        [0.0, 4.0, 0.0, 0.0], [1, 1, 0, 1], [1, 0, 1, 1])  # fmt: skip
    joints["bound"], joints["limit"][1, 2] = 2.0, 5.0
    for name in ("e", "e_dot", "u_fpid", "u_m"):
        joints[name] = rng.normal(size=(4, 3))
    demand, b = np.full((2, 4, 3), np.nan)
    supervisor.weigh(alive, robots, joints, demand, b)
    e, rate, u = joints["e"], joints["e_dot"], joints["u_fpid"] + joints["u_m"]
    assert demand[:3] == pytest.approx((0.5 * e + rate)[:3], rel=1e-14)
    assert b[:3] == pytest.approx((P[0, 1] * e + P[1, 1] * rate)[:3], rel=1e-14)
    assert (demand[3] == 0.0).all()
    assert (b[3] == 0.0).all()
    gravity, coriolis, feedforward = rng.normal(size=(3, 4, 3))
    w = np.array([[0.0, -1e-9, 7.0], [2.0, -1.0, 9.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]])
    torque = np.full((4, 3), 0.5)
    supervisor.supervise(
        alive, robots, joints, gravity, coriolis, demand, feedforward, w, torque
    )  # fmt: skip
    size = 2.0 + np.abs(u) + np.abs(coriolis) + np.abs(demand) + np.abs(feedforward)
    sgn = (size + np.abs(gravity))[0] * [0.0, -1.0, 1.0]
    ramp = size[1] * [0.5, -0.25, 1.0]
    assert joints["u_s"][:2] == pytest.approx(np.array([sgn, ramp]), rel=1e-14)
    asked = (u + joints["u_s"])[:2]
    assert torque[:2] == pytest.approx(np.clip(asked, -joints["limit"][:2], joints["limit"][:2]))
    assert joints["cut"][:2] == pytest.approx(asked - torque[:2], rel=1e-14)
    assert joints["cut"][1, 2] > 0.0
    assert (torque[2:] == 0.5).all()
    assert (joints["u_s"][2:] == 0.0).all()


def test_the_ball_is_where_v_of_the_look_ahead_is_at_most_v_t():
    """A point of its boundary, in any direction from its centre, has V_T: by V itself."""
    rng = np.random.default_rng(0)
    robots, joints = records(runs=20, n=3)
    joints["v_hat"], joints["xi"] = rng.normal(size=(2, 20, 3)) * 0.1
    e, v_ref = rng.normal(size=(2, 20, 3)) * 0.2
    a_ref, a = rng.normal(size=(2, 20, 3)) * 40.0
    found, direction = project(robots, joints, e, v_ref, a_ref, a)
    assert found
    rate, a0, ahead = v_ref - joints["v_hat"], a_ref - a - joints["xi"], 3.0 * H
    assert np.linalg.norm(direction, axis=1) == pytest.approx(np.ones(20), rel=1e-14)
    centre = a0 - robots["distance"][:, np.newaxis] * direction
    for _ in range(5):
        to = rng.normal(size=a0.shape)
        to *= (robots["radius"] / np.linalg.norm(to, axis=1))[:, np.newaxis]
        on = centre + to
        v = energy(e + ahead * rate + ahead * H / 2.0 * on, rate + ahead * on)
        assert v == pytest.approx(np.full(20, 0.5), rel=1e-10)


def test_where_even_the_least_v_is_beyond_v_t_the_ball_is_its_centre():
    robots, joints = records(n=1)
    _, direction = project(robots, joints, np.full((1, 1), 10.0))
    assert robots["radius"][0] == 0.0
    supervisor.shorten(np.array([True]), robots, joints, 0.0 * direction, direction)
    assert abs(direction[0, 0]) == pytest.approx(robots["distance"][0], rel=1e-14)


@pytest.mark.parametrize(
    ("changes", "e"),
    [
        ({"lookahead": 0.0}, 0.7),  # not a sampled one
        ({"trigger": 1.0}, 0.7),  # V = 0.86 (per joint 0.43) is below V_on
        ({}, 0.0),  # the error is at rest where it should be: z is 0
    ],
)
def test_it_does_nothing_where_there_is_nothing_to_do(changes, e):
    robots, joints = records(**changes)
    robots["pushing"] = 1
    found, direction = project(robots, joints, e)
    assert not found
    assert (direction == 0.0).all()
    assert (robots["pushing"] == 0).all()


def test_what_is_reserved_lengthens_the_change_up_to_the_centre():
    robots, joints = records(runs=4)
    e, alive = np.full((4, 2), 0.6), np.array([True, True, True, False])
    project(robots, joints, e, acceleration=-80.0)
    size, radius = robots["distance"][0], robots["radius"][0]
    assert size > radius > 0.0
    joints["bound"][1] = [2.0, 3.0]
    joints["bound"][2] = 1e4
    direction = np.tile([0.6, -0.8], (4, 1))
    reserve = np.tile([-0.5, 0.25], (4, 1))  # M^-1 of the direction
    assert supervisor.shorten(alive, robots, joints, reserve, direction)
    change = [size - radius, size - radius + 2.0 * 0.5 + 3.0 * 0.25, size, 0.0]
    assert direction == pytest.approx(np.multiply.outer(change, [0.6, -0.8]), rel=1e-14)
    assert robots["pushing"].tolist() == [1, 1, 1, 0]


def test_within_the_ball_nothing_is_changed():
    robots, joints = records()
    found, direction = project(robots, joints, 0.1)
    assert found
    assert robots["distance"][0] < robots["radius"][0]
    alive = np.array([True])
    assert not supervisor.shorten(alive, robots, joints, 0.0 * direction, direction)
    assert (direction == 0.0).all()
    assert robots["pushing"][0] == 0


def test_the_dead_are_left_alone():
    robots, joints = records(runs=2)
    e = np.full((2, 2), 5.0)
    found, direction = project(robots, joints, e, alive=np.array([False, True]))
    assert found
    assert (direction[0] == 0.0).all()
    assert (direction[1] != 0.0).all()


def test_u_s_is_added_and_cut_where_it_acts():
    robots, joints = records(runs=3)
    robots["pushing"] = [1, 0, 1]
    joints["u_fpid"], joints["u_m"], joints["limit"] = 2.0, 1.0, 5.0
    u_s, torque = np.array([[1.0, 4.0]] * 3), np.full((3, 2), 3.0)
    supervisor.push(np.array([True, True, False]), robots, joints, u_s, torque)
    assert torque.tolist() == [[4.0, 5.0], [3.0, 3.0], [3.0, 3.0]]
    assert joints["u_s"].tolist() == [[1.0, 4.0], [0.0, 0.0], [0.0, 0.0]]
    assert joints["cut"].tolist() == [[0.0, 2.0], [0.0, 0.0], [0.0, 0.0]]
