"""The law's kernels against the equations, written out apart."""

import numpy as np
import pytest

from fpid_pin.kernels import law
from fpid_pin.kernels.operator import MODE, OPERATOR, POLE

pytestmark = pytest.mark.kernels
H = 1e-3


def robot(runs=1, n=2, **joint):
    """Return the records of integer PIDs (orders 1: I^1 e is int e, D^1 e is e')."""
    robots, joints = np.zeros(runs, law.ROBOT), np.zeros((runs, n), law.JOINT)
    robots["h"], robots["threshold"] = H, np.inf
    joints["limit"], joints["scale"] = np.inf, 1.0
    for name, value in joint.items():
        joints[name] = value
    ops = np.zeros((runs, n, 2), OPERATOR)
    ops["order"] = [0.0, 1.0]
    poles, modes = np.zeros((1, 1), POLE), np.zeros((runs, n, 2, 1), MODE)
    # A table of orders is for those that move: test_kernel_moving.py.
    return robots, joints, ops, poles, modes, np.zeros((4, 4))


def ticks(records, inputs, alive=None):
    """Run ticks on inputs (K, 5, runs, n); return torques and copies of the joints."""
    runs, n = records[1].shape
    alive = np.ones(runs, bool) if alive is None else alive
    torque, found, seen = np.zeros((runs, n)), [], []
    for row in inputs:
        law.fpids(alive, *records, row, torque)
        found.append(torque.copy())
        seen.append(records[1].copy())
    return np.array(found), np.array(seen)


def signals(count, runs=1, n=2, seed=0):
    return np.random.default_rng(seed).normal(size=(count, 5, runs, n))


@pytest.mark.parametrize("printed", [0, 1])
def test_gains_follow_30_to_32_and_torques_10(printed):
    rates = {"gamma_p": 3.0, "gamma_i": 5.0, "gamma_d": 7.0, "k0": 1.5, "k1": 2.5}
    records = robot(kp=10.0, ki=20.0, kd=5.0, scale=2.0, **rates)
    records[0]["printed"] = printed
    inputs = signals(20)
    torque, seen = ticks(records, inputs)
    e, rate = inputs[:, 2, 0] - inputs[:, 0, 0], inputs[:, 3, 0] - inputs[:, 1, 0]
    steps = H / 2 * (e[1:] + e[:-1]) + H**2 / 12 * (rate[:-1] - rate[1:])
    integral = np.vstack([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    surface = -(rate + 2.5 * e + 1.5 * integral)
    phi = {"kp": (3.0, e, 10.0), "ki": (5.0, integral, 20.0), "kd": (7.0, rate, 5.0)}
    u = 0.0
    for name, (gamma, regressor, start) in phi.items():
        moved = np.cumsum(-H * gamma * surface * regressor, axis=0)
        gains = start + np.vstack([np.zeros((1, 2)), moved[:-1]])
        assert seen[name][:, 0] == pytest.approx(gains, rel=1e-13)
        u = u + 2.0 * gains * regressor
    assert torque[:, 0] == pytest.approx(u, rel=1e-12)


def test_one_that_has_ended_is_left_alone():
    records = robot(runs=2, kp=1.0)
    torque, seen = ticks(records, signals(3, runs=2), alive=np.array([True, False]))
    assert (torque[:, 0] != 0.0).all()
    assert (torque[:, 1] == 0.0).all()
    assert (seen["e"][:, 1] == 0.0).all()


def test_what_winds_up_is_held_and_what_unwinds_goes_on():
    records = robot(n=1, kp=1.0, ki=1.0, limit=0.5, gamma_p=1.0, k1=1.0)
    push = np.zeros((4, 5, 1, 1))
    push[:, 2] = 1.0  # e = 1: the torque is cut by 0.5
    _, seen = ticks(records, push)
    assert (seen["int_e"][:, 0, 0] == 0.0).all()
    assert (seen["kp"][:, 0, 0] == 1.0).all()
    back = push.copy()
    back[:, 2] = -1.0
    _, seen = ticks(records, back[:1])
    assert seen["int_e"][0, 0, 0] == 0.0  # h/2 (e + e_) of -1 and 1
    _, seen = ticks(records, 0.1 * back)
    assert (np.diff(seen["int_e"][:, 0, 0]) < 0.0).all()


def test_safeguards_leak_project_and_ignore_small_surfaces():
    guarded = {"kp_0": 10.0, "kp": 12.0, "kp_min": 9.0, "kp_max": 11.0, "ki_max": 1.0,
               "kd_max": 1.0, "gamma_p": 4.0, "sigma": 3.0, "nu": 0.5, "dead_zone": 0.4,
               "e": 0.1}  # fmt: skip
    joints = np.zeros(3, law.JOINT)
    for name, value in guarded.items():
        joints[name] = value
    joints["kp_max"] = [100.0, 11.0, 100.0]
    joints["s"] = [-1.0, -1.0, 0.3]
    for j in range(3):
        law.adapt(joints[j], 0, 1, H)
    s = -0.6  # what is beyond the dead zone
    leak = (3.0 + 0.5 * 4.0 * 0.6) * 2.0
    assert joints["kp"][0] == pytest.approx(12.0 - H * 4.0 * s * 0.1 - H * leak, rel=1e-14)
    assert joints["kp"][1] == 11.0
    assert joints["kp"][2] == pytest.approx(12.0 - H * 3.0 * 2.0, rel=1e-14)


def test_the_supervisor_adds_what_equation_20_says():
    from fpid_pin.kernels import supervisor

    records = robot(runs=3, kp=1.0, bound=2.0)
    robots, joints = records[:2]
    robots["p11"], robots["p12"], robots["p22"] = 1.75, 1.0, 1.5
    robots["k0"], robots["k1"] = 0.5, 1.0
    robots["threshold"] = [0.0, 0.0, np.inf]
    robots["layer"] = [0.0, 4.0, 0.0]
    robots["own_gravity"] = [1, 0, 0]
    joints["limit"][1, 1] = 3.0
    inputs = signals(1, runs=3, seed=4)
    torque = np.zeros((3, 2))
    alive = np.ones(3, bool)
    assert law.fpids(alive, *records, inputs[0], torque)
    e, rate = inputs[0, 2] - inputs[0, 0], inputs[0, 3] - inputs[0, 1]
    v = 0.5 * (1.75 * e**2 + 2.0 * e * rate + 1.5 * rate**2).sum(axis=1)
    assert robots["value"] == pytest.approx(v, rel=1e-13)
    demand, b = np.zeros((2, 3, 2))
    supervisor.weigh(alive, robots, joints, demand, b)
    assert demand == pytest.approx(0.5 * e + rate, rel=1e-14)
    assert b == pytest.approx(e + 1.5 * rate, rel=1e-14)
    g, c, d, f, w = np.random.default_rng(5).normal(size=(5, 3, 2))
    w[0] = [0.0, -1.0]
    u = torque.copy()
    supervisor.supervise(alive, robots, joints, g, c, d, f, w, torque)
    size = 2.0 + np.abs(u) + np.abs(c) + np.abs(d) + np.abs(f)
    assert torque[0] == pytest.approx(u[0] + [0.0, -(size + np.abs(g))[0, 1]], rel=1e-14)
    ramp = size[1] * np.clip(w[1] / 4.0, -1.0, 1.0)
    assert joints["u_s"][1] == pytest.approx(ramp, rel=1e-14)
    assert torque[1, 1] == pytest.approx(np.clip(u[1, 1] + ramp[1], -3.0, 3.0), rel=1e-14)
    assert joints["cut"][1, 1] == pytest.approx(u[1, 1] + ramp[1] - torque[1, 1], rel=1e-14)
    assert (torque[2] == u[2]).all()
    # While it acts gains and integrals stand still.
    gains = joints["kp"].copy()
    joints["gamma_p"] = 25.0
    law.fpids(alive, *records, signals(1, runs=3, seed=6)[0], torque)
    assert (joints["kp"][:2] == gains[:2]).all()
    assert (joints["int_e"][:2] == 0.0).all()
    assert (joints["kp"][2] != gains[2]).all()
    # A run that has ended asks the model for nothing; a positive w pushes the other way.
    alive[1] = False
    supervisor.weigh(alive, robots, joints, demand, b)
    assert (demand[1] == 0.0).all()
    w[0] = 1.0
    u = joints["u_fpid"].copy()
    supervisor.supervise(alive, robots, joints, g, c, d, f, w, torque)
    assert (torque[0] > u[0]).all()
