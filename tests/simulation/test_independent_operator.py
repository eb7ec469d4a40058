"""The paper's experiment in closed loop against fractional operators of another kind.

On the other side are the loop of `by_hand` and an operator that keeps the whole past. That the
paper's arm is that of (35) is in tests/arms/test_planar.py.
"""

import dataclasses
import math

import by_hand
import numpy as np
import pytest

import fpid_pin as fp

STEP = 1e-3
# (lambda, mu) by joint: as published, and a pair far from it whose memory is longer.
PUBLISHED = (0.901, 0.931), (0.921, 0.932)
LONG = (0.6, 0.4), (0.5, 0.75)


class ProductIntegration:
    """The kernel integrated exactly against the package's rule for the rate, over the whole past.

    Within a step theta runs back from its newest sample and f' is taken as the quadratic that
    takes both measured rates and integrates to the measured change of f,

        f'(theta) = (1 - theta) f'_j + theta f'_(j-1) + 6 theta (1 - theta) m_j
        m_j = (f_j - f_(j-1))/h - (f'_j + f'_(j-1))/2

    and a step that lies i steps back weighs these three by

        h^(1-alpha)/Gamma(1-alpha) int_0^1 (i + theta)^-alpha {1-theta, theta, 6 theta (1-theta)}
    """

    def __init__(self, alpha, step, rows):
        self.step, self.k = step, -1
        self.past = np.zeros((3, alpha.size, rows))
        scale = [step ** (1.0 - a) / math.gamma(1.0 - a) for a in alpha]
        shares = [s * step_shares(a, rows)[:, ::-1] for s, a in zip(scale, alpha, strict=True)]
        self.weights = np.stack(shares, axis=1)

    def __call__(self, f, rate):
        self.k += 1
        if self.k > 0:
            mean = (f - self.last[0]) / self.step - 0.5 * (rate + self.last[1])
            self.past[:, :, self.k - 1] = rate, self.last[1], mean
        self.last = f, rate
        # Newest last: the past so far times the tail of the weights.
        tail = self.weights.shape[2] - self.k
        parts = [
            [past[: self.k] @ weights[tail:] for past, weights in zip(*pair, strict=True)]
            for pair in zip(self.past, self.weights, strict=True)
        ]
        return np.sum(parts, axis=0)


def step_shares(alpha, count):
    """Return int_0^1 (i + theta)^-alpha {1-theta, theta, 6 theta(1-theta)}, (3, count).

    The newest step, i = 0, by Euler's beta function. For the others the powers' closed form
    cancels all but i^3 of its digits, while Gauss' rule of 20 nodes has an error of
    5.8^-40 = 1e-31 at most: (i + theta)^-alpha has its pole a whole step away.
    """
    nodes, weights = np.polynomial.legendre.leggauss(20)
    theta, weights = 0.5 * (1.0 + nodes), 0.5 * weights
    shapes = np.stack([1.0 - theta, theta, 6.0 * theta * (1.0 - theta)])
    kernel = (np.arange(1, count)[:, np.newaxis] + theta) ** -alpha
    newest = np.array([1.0 / (1.0 - alpha), 1.0, 6.0 / (3.0 - alpha)]) / (2.0 - alpha)
    return np.column_stack([newest, (shapes * weights) @ kernel.T])


class Recorded(by_hand.Fpid):
    """The law of section 5.1, which keeps its gains and its surface, (4, n) a tick."""

    def __init__(self, orders, regressors, rows):
        gains = [np.array(k) for k in ((10.0, 12.0), (25.0, 20.0), (20.0, 15.0))]
        # D^(1-lambda) of int e for both joints, then D^mu of e.
        alpha = np.concatenate([1.0 - np.array(orders[0]), orders[1]])
        operator = ProductIntegration(alpha, STEP, rows)
        super().__init__(gains, [25.0] * 3, 1.0, 2.0, operator, regressors)
        self.kept = []

    def torque(self, x):
        torque = super().torque(x)
        self.kept.append([*self.gains, self.s])
        return torque


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
    run, arm = fp.simulate(fp.paper_experiment(duration=10.0), law), fp.Arm.two_link()
    hand = Recorded(orders, regressors, len(run.t))
    q, torque = by_hand.simulate(
        by_hand.Loop(arm, hand, STEP), arm,
        lambda t: (np.full(2, math.sin(t)), np.full(2, math.cos(t)), np.full(2, -math.sin(t))),
        np.array([0.0, 0.35]), np.array([-0.2, 0.5]), len(run.t),
        lambda t: np.array([0.4, 0.6]) * math.cos(5.0 * math.pi * t),
    )  # fmt: skip
    *gains, s = np.swapaxes(hand.kept, 0, 1)
    assert largest(run.q - q) < 1e-11
    assert largest(run.s - s) < 3e-11
    assert largest(run.torque - torque) < 1e-11 * largest(torque)
    for ours, theirs in zip((run.kp, run.ki, run.kd), gains, strict=True):
        assert largest(ours - theirs) < 3e-10
