"""The paper's experiment in closed loop against fractional operators of another kind.

Everything on the other side is in `paper_by_hand`: dynamics by (35), law, loop, and an operator
that keeps the whole past.
"""

import dataclasses

import numpy as np
import pytest
from paper_by_hand import LONG, PUBLISHED, closed_loop

import fpid_pin as fp


def largest(difference):
    return float(np.abs(difference).max())


@pytest.mark.parametrize(
    ("orders", "regressors"), [(PUBLISHED, "law"), (LONG, "law"), (PUBLISHED, "integer")],
    ids=["published", "long memory", "integer regressors"],
)  # fmt: skip
def test_the_whole_past_with_the_same_rule_gives_the_same_run(orders, regressors):
    """No exponential sum on the other side: only the kernel's error, 1e-11, may be left.

    Found over 20 s at 1 ms: 2.4e-12 rad, 5e-11 of a gain, 2.4e-12 of the torque (published);
    1.5e-13, 5e-12, 2e-13 (long memory). The kernel is that of 20 s, of which half is simulated.
    """
    law = dataclasses.replace(
        fp.paper_controller(), integral_order=orders[0], derivative_order=orders[1],
        regressors=regressors, design=fp.fractional.ExponentialSum(modes=40),
    )  # fmt: skip
    run = fp.simulate(fp.paper_experiment(duration=10.0), law)
    hand = closed_loop(1e-3, 10.0, orders, regressors)
    assert largest(run.q - hand.q) < 1e-11
    assert largest(run.s - hand.s) < 3e-11
    assert largest(run.torque - hand.torque) < 1e-11 * largest(hand.torque)
    for gains, expected in zip((run.kp, run.ki, run.kd), hand.gains.swapaxes(0, 1), strict=True):
        assert largest(gains - expected) < 3e-10
