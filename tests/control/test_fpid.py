"""The adaptive FPID against laws written out by hand."""

import dataclasses

import numpy as np
import pinocchio as pin
import pytest

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError


def plain_integer_loop(experiment, kp, ki, kd, gamma, k0, k1):
    """An adaptive integer PID on Pinocchio as anyone would write it, one robot."""
    model = experiment.arm.model
    data = model.createData()
    h, rows = experiment.step, experiment.rows
    q, v = np.array(experiment.q0), np.array(experiment.v0)
    gains = [np.array(kp), np.array(ki), np.array(kd)]
    integral, last = np.zeros(2), None
    angles, torques = [], []
    for k in range(rows):
        t = k * h
        e, rate = np.sin(t) - q, np.cos(t) - v
        if last is not None:
            integral = integral + h * (e + last[0]) / 2 + h**2 * (last[1] - rate) / 12
        last = (e, rate)
        terms = [e, integral, rate]
        u = sum(gain * term for gain, term in zip(gains, terms, strict=True))
        angles.append(q)
        torques.append(u)
        s = -(rate + k1 * e + k0 * integral)
        gains = [g - h * gamma * s * term for g, term in zip(gains, terms, strict=True)]
        d = np.array([0.4, 0.6]) * np.cos(5 * np.pi * t)
        v = v + h * pin.aba(model, data, q, v, u + d)
        q = q + h * v
    return np.array(angles), np.array(torques)


def test_orders_one_are_a_plain_adaptive_integer_pid():
    experiment = fp.paper_experiment()
    run = fp.simulate(experiment, fp.paper_controller("integer"))
    q, u = plain_integer_loop(experiment, (10, 12), (25, 20), (20, 15), 25.0, 1.0, 2.0)
    assert np.abs(run.q - q).max() < 1e-12
    assert np.abs(run.torque - u).max() < 1e-10 * np.abs(u).max()


def test_orders_that_change_want_shared_poles_and_may_ramp():
    arm, fixed = fp.Arm.two_link(), {"kp": 10.0, "ki": 25.0, "kd": 20.0, "learning_rate": 0.0}
    crone = fp.AdaptiveFpid(**fixed, integral_order=0.9, design=fp.fractional.Crone())
    with pytest.raises(fp.exceptions.DesignError, match="shared poles, got Crone"):
        crone.start(arm, step=1e-3).state.set_orders(integral_order=0.5)
    early, late = (
        fp.AdaptiveFpid(**fixed, derivative_order=mu).start(arm, step=1e-3) for mu in (0.6, 0.9)
    )
    late.state.set_orders(derivative_order=0.6, ramp=0.05)
    rng = np.random.default_rng(4)
    for k in range(100):
        inputs = rng.normal(size=(4, 2))
        pair = late.torque(*inputs), early.torque(*inputs)
        if 0 < k < 40:  # at k = 0 both are 0
            assert (pair[0] != pair[1]).any()
        if k >= 50:
            assert np.abs(pair[0] - pair[1]).max() < 1e-9 * np.abs(pair[1]).max()


def test_a_design_that_keeps_the_past_is_for_signals():
    law = dataclasses.replace(fp.paper_controller(), design=fp.fractional.L1())
    with pytest.raises(ArgumentError, match="design: expected one with modes, got L1"):
        law.start(fp.Arm.two_link(), step=1e-3)
    with pytest.raises(ArgumentError, match="design: expected a Design, got str"):
        dataclasses.replace(fp.paper_controller(), design="crone")


def test_without_learning_the_gains_stay():
    controller = dataclasses.replace(fp.paper_controller(), learning_rate=0.0)
    run = fp.simulate(fp.paper_experiment(duration=0.2), controller)
    assert (run.kp == [10.0, 12.0]).all()
    assert (run.ki == [25.0, 20.0]).all()
    assert (run.kd == [20.0, 15.0]).all()


def recorded(orders="symbol", duration=2.0, **changes):
    controller = dataclasses.replace(fp.paper_controller(orders, supervised=False), **changes)
    return controller, fp.simulate(fp.paper_experiment(duration=duration), controller)


@pytest.mark.parametrize("regressors", ["law", "integer"])
def test_the_record_satisfies_equations_10_21_and_30_to_32(regressors):
    """Torque, surface and gains recomputed from q alone, by full-memory quadrature."""
    controller, run = recorded(regressors=regressors, learning_rate=(3.0, 7.0))
    h, e = run.step, run.error
    rate = run.v_ref - run.v
    integral = np.zeros_like(e)
    steps = h * (e[1:] + e[:-1]) / 2 + h**2 * (rate[:-1] - rate[1:]) / 12
    integral[1:] = np.cumsum(steps, axis=0)
    surface = -(rate + 2.0 * e + 1.0 * integral)
    assert np.abs(run.s - surface).max() < 1e-11
    bank = fp.fractional.Bank(
        controller.design, [[1 - 0.901, 1 - 0.931], [0.921, 0.932]], step=h, horizon=20.0
    )
    fractional = np.array(
        [bank.update(np.stack([i, x]), np.stack([x, r])).copy()
         for i, x, r in zip(integral, e, rate, strict=True)]
    )  # fmt: skip
    terms = [e, fractional[:, 0], fractional[:, 1]]
    u = run.kp * terms[0] + run.ki * terms[1] + run.kd * terms[2]
    assert np.abs(run.u_fpid - u).max() < 1e-10 * np.abs(u).max()
    regressed = terms if regressors == "law" else [e, integral, rate]
    for gains, phi in zip((run.kp, run.ki, run.kd), regressed, strict=True):
        growth = -h * np.array([3.0, 7.0]) * run.s * phi
        assert np.abs(np.diff(gains, axis=0) - growth[:-1]).max() < 1e-11


def test_learning_rates_may_differ_between_the_three_gains():
    rates = np.array([[5.0, 5.0], [0.0, 0.0], [1.0, 2.0]])
    _, run = recorded(learning_rate=rates, duration=0.5)
    assert (run.ki == [25.0, 20.0]).all()
    assert (run.kp[-1] != run.kp[0]).all()
    assert (run.kd[-1] != run.kd[0]).all()


def test_the_inertia_scale_multiplies_by_the_diagonal_of_m_at_home():
    arm = fp.Arm.two_link()
    controller = fp.AdaptiveFpid(kp=3.0, ki=0.0, kd=0.0, learning_rate=0.0, scale="inertia")
    loop = controller.start(arm, step=1e-3)
    tau = loop.torque([0.1, 0.2], [0.0, 0.0], [0.4, 0.1], [0.0, 0.0])
    assert np.allclose(tau, np.diag(arm.mass_matrix(arm.home)) * 3.0 * np.array([0.3, -0.1]))


def test_a_loop_gives_what_the_simulation_gave():
    controller = fp.paper_controller()
    experiment = fp.paper_experiment(duration=0.3)
    run = fp.simulate(experiment, controller)
    loop = controller.start(experiment.arm, step=experiment.step, horizon=20.0)
    for k, t in enumerate(run.t):
        reference = np.sin([t, t]), np.cos([t, t]), -np.sin([t, t])
        tau = loop.torque(run.q[k], run.v[k], *reference)
        assert (tau == run.torque[k]).all()
        assert (loop.signals()["kd"] == run.kd[k]).all()


def test_orders_changed_on_the_way_are_those_of_a_law_that_had_them_from_the_start():
    arm = fp.Arm.two_link()
    fixed = {"kp": 10.0, "ki": 25.0, "kd": 20.0, "learning_rate": 0.0}
    late = fp.AdaptiveFpid(**fixed, integral_order=0.9, derivative_order=0.6).start(arm, step=1e-3)
    early = fp.AdaptiveFpid(**fixed, integral_order=0.5, derivative_order=0.8).start(arm, step=1e-3)
    rng = np.random.default_rng(3)
    for k in range(400):
        if k == 200:
            late.state.set_orders(integral_order=0.5, derivative_order=0.8)
        inputs = rng.normal(size=(4, 2))
        pair = late.torque(*inputs), early.torque(*inputs)
        if k >= 200:
            assert np.abs(pair[0] - pair[1]).max() < 1e-9 * np.abs(pair[1]).max()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"kp": -1.0}, r"kp: expected a number >= 0, got -1"),
        ({"kp": (1.0, np.nan)}, r"kp.1: expected a number >= 0, got nan"),
        ({"kp": (1.0, 2.0, 3.0)}, r"ki: .*one length for all joints, \(3,\) as kp, got \(2,\)"),
        ({"integral_order": 1.7}, r"integral_order: expected a number in \[0, 1\], got 1.7"),
        ({"derivative_order": (0.5, -0.1)}, r"derivative_order.1: .* got -0.1"),
        ({"learning_rate": np.inf}, r"learning_rate: .* got inf"),
        ({"regressors": "laws"}, r"one of law, integer, got 'laws' \(did you mean law\?\)"),
        ({"kd": True}, r"kd: expected numbers, got True"),
        ({"supervisor": 5.0}, r"supervisor: expected a Supervisor or None, got float"),
    ],
)
def test_bad_arguments_give_one_clear_line(changes, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        dataclasses.replace(fp.paper_controller(), **changes)
    assert "\n" not in str(caught.value)


def test_a_wrong_number_of_joints_names_both():
    controller = fp.AdaptiveFpid(kp=(1.0, 2.0, 3.0), ki=1.0, kd=1.0)
    with pytest.raises(ArgumentError, match=r"kp: expected shape \(2,\) .* got shape \(3,\)"):
        controller.start(fp.Arm.two_link(), step=1e-3)
    with pytest.raises(ArgumentError, match="step: expected a number > 0, got 0"):
        fp.paper_controller().start(fp.Arm.two_link(), step=0.0)


def test_a_loop_refuses_bad_measurements_and_is_not_moved_by_them():
    loops = [fp.paper_controller().start(fp.Arm.two_link(), step=1e-3) for _ in range(2)]
    good = np.array([[0.1, 0.2], [0.0, 0.1], [0.3, 0.3], [0.1, 0.0]])
    with pytest.raises(ArgumentError, match=r"v: expected shape \(2,\)"):
        loops[0].torque(good[0], [0.0], good[2], good[3])
    with pytest.raises(ArgumentError, match=r"q.1: .* got nan"):
        loops[0].torque([0.0, np.nan], good[1], good[2], good[3])
    first, second = (loop.torque(*good) for loop in loops)
    assert (first == second).all()


def test_a_loop_that_outlives_its_horizon_says_so_once():
    loop = fp.paper_controller().start(fp.Arm.two_link(), step=1e-3, horizon=0.05)
    inputs = np.zeros((4, 2))
    for _ in range(51):
        loop.torque(*inputs)
    with pytest.warns(fp.FpidWarning, match=r"past its horizon of 0.05 s"):
        loop.torque(*inputs)
    for _ in range(100):
        loop.torque(*inputs)
