"""What an adaptive FPID and its loop refuse.

That it is the law of the paper is in tests/simulation/test_independent_operator.py.
"""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError


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
        ({"design": "crone"}, r"design: expected a Design, got str"),
        ({"design": fp.fractional.L1()}, r"design: expected one with modes, got L1"),
        ({"supervisor": 5.0}, r"supervisor: expected a Supervisor or None, got float"),
    ],
)
def test_bad_arguments_give_one_clear_line(changes, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        dataclasses.replace(fp.paper_controller(), **changes).start(fp.Arm.two_link(), step=1e-3)
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
