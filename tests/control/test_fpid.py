"""The adaptive FPID against laws written out by hand."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError


def test_a_design_that_keeps_the_past_is_for_signals():
    law = dataclasses.replace(fp.paper_controller(), design=fp.fractional.L1())
    with pytest.raises(ArgumentError, match="design: expected one with modes, got L1"):
        law.start(fp.Arm.two_link(), step=1e-3)
    with pytest.raises(ArgumentError, match="design: expected a Design, got str"):
        dataclasses.replace(fp.paper_controller(), design="crone")


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
