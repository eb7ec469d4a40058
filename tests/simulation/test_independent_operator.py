"""The paper's experiment in closed loop against fractional operators of another kind.

Everything on the other side is in `paper_by_hand`: dynamics by (35), law, loop, and an operator
that keeps the whole past. Each test's docstring says by how much the two must differ, and why.
"""

import dataclasses
import itertools

import mpmath as mp
import numpy as np
import paper_by_hand as by_hand
import pytest
from paper_by_hand import LONG, PUBLISHED, closed_loop

import fpid_pin as fp

ORDERS = pytest.mark.parametrize("orders", [PUBLISHED, LONG], ids=["published", "long memory"])


def engine(step, duration, orders, modes=40):
    """Simulate with orders and modes as given; with 40 the kernel is exact within 1e-11."""
    law = dataclasses.replace(
        fp.paper_controller(),
        integral_order=orders[0],
        derivative_order=orders[1],
        design=fp.fractional.ExponentialSum(modes=modes),
    )
    return fp.simulate(fp.paper_experiment(duration=duration, step=step), law)


def largest(difference):
    return float(np.abs(difference).max())


@ORDERS
def test_the_whole_past_with_the_same_rule_gives_the_same_run(orders):
    """No exponential sum on the other side: only the kernel's error, 1e-11, may be left.

    Found over 20 s at 1 ms: 2.4e-12 rad, 5e-11 of a gain, 2.4e-12 of the torque (published);
    1.5e-13, 5e-12, 2e-13 (long memory). The kernel is that of 20 s, of which half is simulated.
    """
    run = engine(1e-3, 10.0, orders)
    hand = closed_loop(
        by_hand.ProductIntegration, step=1e-3, duration=10.0, orders=orders, corrected=True
    )
    assert largest(run.q - hand.q) < 1e-11
    assert largest(run.s - hand.s) < 3e-11
    assert largest(run.torque - hand.torque) < 1e-11 * largest(hand.torque)
    for gains, expected in zip((run.kp, run.ki, run.kd), hand.gains.swapaxes(0, 1), strict=True):
        assert largest(gains - expected) < 3e-10


def test_fewer_modes_cost_the_angles_less_than_they_cost_the_kernel():
    """The kernel is within 6e-7 with 24 modes (the default) and 1e-9 with 32.

    Found over 20 s at 2 ms: 7.5e-9 and 2.2e-11 rad; at 1 ms 2.1e-8 and 5.6e-11.
    """
    hand = closed_loop(by_hand.ProductIntegration, step=2e-3, duration=20.0, corrected=True)
    for modes, bound in ((24, 1e-7), (32, 3e-10)):
        assert largest(engine(2e-3, 20.0, PUBLISHED, modes).q - hand.q) < bound


def test_a_grunwald_letnikov_loop_ten_times_finer_has_the_same_limit():
    """The whole loop, plant, law and eq. (1), at h/10 against the engine at h.

    Both are of order one: Euler's steps, the held torque, the sum (1) itself. Largest difference
    of the angles over 2 s, engine at 2 and 1 ms against the loop at 0.2 and 0.1 ms, 1e-4 rad:
    12.55 6.15.
    Richardson's extrapolation of the two loops is their limit (within 1e-7, by a third loop at
    0.05 ms). The engine at 2, 1, 0.5, 0.25 ms is away from it by, 1e-4 rad,
    14.20 6.97 3.43 1.69 (orders 1.03 1.02 1.02); once extrapolated itself, by 0.259 0.118 0.055:
    an order above one, since torques that grow like t^(1 - mu) from the start are not smooth.
    """
    steps = [2e-3, 1e-3, 5e-4, 2.5e-4]
    ours = [engine(h, 2.0, PUBLISHED).q[:: 2**k] for k, h in enumerate(steps)]
    theirs = []
    for k, h in enumerate(steps[:2]):
        hand = closed_loop(by_hand.GrunwaldLetnikov, step=h / 10, duration=2.0)
        theirs.append(hand.q[:: 10 * 2**k])
    gaps = [largest(a - b) for a, b in zip(ours[:2], theirs, strict=True)]
    assert gaps[0] / gaps[1] == pytest.approx(2.0, abs=0.1)
    limit = 2.0 * theirs[1] - theirs[0]
    away = np.array([largest(a - limit) for a in ours])
    assert np.log2(away[:-1] / away[1:]) == pytest.approx([1.0] * 3, abs=0.05)
    left = np.array([largest(2.0 * b - a - limit) for a, b in itertools.pairwise(ours)])
    assert (left[:-1] > 2.0 * left[1:]).all()
    assert left[-1] < 8e-6


@pytest.mark.parametrize("alpha", [0.069, 0.5, 0.932])
def test_the_shares_of_a_step_are_those_of_the_powers(alpha):
    """The closed form that cancels, with the digits to spare."""
    shares = by_hand.step_shares(alpha, 2001)
    with mp.workdps(60):
        a = mp.mpf(alpha)
        for i in (0, 1, 2, 17, 2000):

            def moment(k, i=i):
                """Int_0^1 (i + theta)^-alpha theta^k, theta^k = ((i + theta) - i)^k."""
                terms = (
                    mp.binomial(k, m) * mp.mpf(-i) ** (k - m)
                    * ((i + 1) ** (m + 1 - a) - mp.mpf(i) ** (m + 1 - a)) / (m + 1 - a)
                    for m in range(k + 1)
                )  # fmt: skip
                return mp.fsum(terms)

            one, first, second = (moment(k) for k in range(3))
            expected = one - first, first, 6 * (first - second)
            for got, want in zip(shares[:, i], expected, strict=True):
                assert abs(got / want - 1) < 1e-14
