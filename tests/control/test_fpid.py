"""What an adaptive FPID and its loop refuse.

That it is the law of the paper is in tests/simulation/test_independent_operator.py.
"""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.exceptions import ArgumentError


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
