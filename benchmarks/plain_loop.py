"""The loop that a good user of NumPy and Pinocchio would write: one robot, one run.

The same law as `fpid_pin.AdaptiveFpid` with the same exponential-sum design. All modes, of both
joints and both terms, are one array: 20 us a step where an array for each term takes 37. It is the
yardstick of benchmarks/speed.py and a check on the engine: both must agree.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import fpid_pin as fp
from fpid_pin.simulation.engine import horizon_of

Array = NDArray[np.float64]


class FractionalDerivatives:
    """D^alpha of some signals whose rates are known, (4,): exact newest step, then modes."""

    def __init__(
        self, order: Array, design: fp.fractional.Design, h: float, horizon: float
    ) -> None:
        found = design.coefficients(order, step=h, horizon=horizon)
        p = found.poles[:, np.newaxis]
        theta, weight = np.polynomial.legendre.leggauss(40)
        theta, weight = (theta + 1) / 2, weight / 2
        kernel = h * weight * np.exp(-np.multiply.outer(p, theta) * h)
        self.decay = np.exp(-p * h)
        self.weights = found.weights
        # Of rate, last rate and m: what the modes and the output take of them.
        b1, b0 = (kernel * (1 - theta)).sum(axis=-1), (kernel * theta).sum(axis=-1)
        b2 = (kernel * 6 * theta * (1 - theta)).sum(axis=-1)
        self.drive = np.hstack([b1, b0, b2])
        c1 = np.array([h ** (1 - a) / math.gamma(3 - a) for a in order])
        c2 = np.array([6 * (1 - a) * h ** (1 - a) / math.gamma(4 - a) for a in order])
        self.newest = np.stack([c1, (1 - order) * c1, c2])
        self.h = h
        self.x = np.zeros((len(p), len(order)))
        self.inputs = np.zeros((3, len(order)))

    def update(self, f: Array, f0: Array, rate: Array, rate0: Array) -> Array:
        inputs = self.inputs
        inputs[0], inputs[1] = rate, rate0
        inputs[2] = (f - f0) / self.h - (rate + rate0) / 2
        self.x *= self.decay
        y = (self.newest * inputs).sum(axis=0) + (self.weights * self.x).sum(axis=0)
        self.x += self.drive @ inputs
        return y


def plain_loop(experiment: fp.Experiment, controller: fp.AdaptiveFpid, rows: int) -> Array:
    """Simulate `rows` rows of the paper's experiment and return q, (rows, 2)."""
    model = experiment.arm.model
    data = model.createData()
    h, horizon = experiment.step, horizon_of(experiment.duration)
    q, v = np.array(experiment.q0), np.array(experiment.v0)
    gains = np.array([controller.kp, controller.ki, controller.kd])
    gamma, k0, k1 = (float(x) for x in (controller.learning_rate, controller.k0, controller.k1))
    orders = np.concatenate([1 - controller.integral_order, controller.derivative_order])
    fractional = FractionalDerivatives(orders, controller.design, h, horizon)
    integral, terms = np.zeros(2), np.zeros((3, 2))
    last_e = last_rate = np.zeros(2)
    angles = np.empty((rows, 2))
    amplitude, frequency = np.array([0.4, 0.6]), 5 * math.pi
    for k in range(rows):
        t = k * h
        angles[k] = q
        e = math.sin(t) - q
        rate = math.cos(t) - v
        if k:
            last = integral
            integral = integral + h * (e + last_e) / 2 + h * h * (last_rate - rate) / 12
            f, f0 = np.concatenate([integral, e]), np.concatenate([last, last_e])
            g, g0 = np.concatenate([e, rate]), np.concatenate([last_e, last_rate])
            terms[1:] = fractional.update(f, f0, g, g0).reshape(2, 2)
        terms[0] = e
        last_e, last_rate = e, rate
        u = (gains * terms).sum(axis=0)
        s = rate + k1 * e + k0 * integral
        gains += h * gamma * s * terms
        v = v + h * pin.aba(model, data, q, v, u + amplitude * math.cos(frequency * t))
        q = q + h * v
    return angles
