"""Section 5.1 of the paper written out with NumPy and plain arithmetic: nothing of the package.

Two links by (35), reference (38), disturbance (37), the law (10) with its gradient (30)-(32), and
semi-implicit Euler. The operator of the fractional terms is called once a tick with f, f' of its
four channels: D^(1-lambda) of int e for both joints, then D^mu of e.
"""

import math
from dataclasses import dataclass

import numpy as np

M1, M2, L1, L2, GRAVITY = 1.0, 1.0, 1.0, 0.8, 9.8
KP, KI, KD = np.array([10.0, 12.0]), np.array([25.0, 20.0]), np.array([20.0, 15.0])
GAMMA, K0, K1 = 25.0, 1.0, 2.0
START = np.array([0.0, 0.35]), np.array([-0.2, 0.5])
# (lambda, mu) by joint: as published, and a pair far from it whose memory is longer.
PUBLISHED = (0.901, 0.931), (0.921, 0.932)
LONG = (0.6, 0.4), (0.5, 0.75)


def acceleration(q, v, u):
    """Solve (35), M q'' = u - C q' - G, by Cramer's rule."""
    (q1, q2), (v1, v2) = q, v
    s2, c2, coupling = math.sin(q2), math.cos(q2), M2 * L1 * L2
    m11 = (M1 + M2) * L1**2 + M2 * L2**2 + 2.0 * coupling * c2
    m12, m22 = M2 * L2**2 + coupling * c2, M2 * L2**2
    g2 = GRAVITY * M2 * L2 * math.cos(q1 + q2)
    g1 = GRAVITY * (M1 + M2) * L1 * math.cos(q1) + g2
    r1 = u[0] + coupling * s2 * (2.0 * v1 + v2) * v2 - g1
    r2 = u[1] - coupling * s2 * v1 * v1 - g2
    determinant = m11 * m22 - m12 * m12
    return np.array([m22 * r1 - m12 * r2, m11 * r2 - m12 * r1]) / determinant


@dataclass
class Record:
    """Angles, torques, gains (3, n) and the surface at every tick."""

    q: np.ndarray
    torque: np.ndarray
    gains: np.ndarray
    s: np.ndarray


def closed_loop(step, duration, orders, regressors):
    """Run the experiment; the trapezium that sums e up has Euler and Maclaurin's h^2 term."""
    h, rows = step, round(duration / step) + 1
    alpha = np.concatenate([1.0 - np.array(orders[0]), orders[1]])
    fractional = ProductIntegration(alpha, h, rows)
    gains, (q, v) = np.stack([KP, KI, KD]), START
    total, last, phi, s = np.zeros(2), None, np.zeros((3, 2)), np.zeros(2)
    record = Record(*(np.empty((rows, *shape)) for shape in ((2,), (2,), (3, 2), (2,))))
    for k in range(rows):
        t = k * h
        gains = gains - h * GAMMA * s * phi
        e, e_dot = math.sin(t) - q, math.cos(t) - v
        if last is not None:
            total = total + 0.5 * h * (e + last[0]) + h * h / 12.0 * (last[1] - e_dot)
        last = e, e_dot
        y = fractional(np.concatenate([total, e]), np.concatenate([e, e_dot]))
        terms = np.stack([e, y[:2], y[2:]])
        phi = terms if regressors == "law" else np.stack([e, total, e_dot])
        s = -(e_dot + K1 * e + K0 * total)
        u = (gains * terms).sum(axis=0)
        record.q[k], record.torque[k], record.gains[k], record.s[k] = q, u, gains, s
        push = np.array([0.4, 0.6]) * math.cos(5.0 * math.pi * t)
        v = v + h * acceleration(q, v, u + push)
        q = q + h * v
    return record


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
