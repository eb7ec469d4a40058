"""The loop that a good user of NumPy and Pinocchio would write: one robot, one run.

The same law as `fpid_pin.AdaptiveFpid` with the same exponential-sum design, in the textbook form
of design (poles, one state vector a joint and term), arrays reused where that is natural. It is
the yardstick of benchmarks/speed.py and a check on the engine: both must agree.
"""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

import fpid_pin as fp
from fpid_pin.simulation.engine import horizon_of

Array = NDArray[np.float64]


class FractionalDerivative:
    """D^alpha of two joints' signals whose rates are known: exact newest step, then modes."""

    def __init__(
        self, order: Array, design: fp.fractional.Design, h: float, horizon: float
    ) -> None:
        found = design.coefficients(order, step=h, horizon=horizon)
        p, self.g = found.poles[:, np.newaxis], found.weights
        theta, weight = np.polynomial.legendre.leggauss(40)
        theta, weight = (theta + 1) / 2, weight / 2
        kernel = h * weight * np.exp(-np.multiply.outer(p, theta) * h)
        self.decay = np.exp(-p * h)
        self.b1 = (kernel * (1 - theta)).sum(axis=-1)
        self.b0 = (kernel * theta).sum(axis=-1)
        self.b2 = (kernel * 6 * theta * (1 - theta)).sum(axis=-1)
        self.c1 = np.array([h ** (1 - a) / math.gamma(3 - a) for a in order])
        self.c0 = (1 - order) * self.c1
        self.c2 = np.array([6 * (1 - a) * h ** (1 - a) / math.gamma(4 - a) for a in order])
        self.h = h
        self.x = np.zeros((len(p), len(order)))
        self.last: tuple[Array, Array] | None = None

    def update(self, f: Array, rate: Array) -> Array:
        if self.last is None:
            self.last = (f, rate)
            return np.zeros_like(f)
        f0, rate0 = self.last
        m = (f - f0) / self.h - (rate + rate0) / 2
        self.x *= self.decay
        y = self.c1 * rate + self.c0 * rate0 + self.c2 * m + (self.g * self.x).sum(axis=0)
        self.x += self.b1 * rate + self.b0 * rate0 + self.b2 * m
        self.last = (f, rate)
        return y


def plain_loop(experiment: fp.Experiment, controller: fp.AdaptiveFpid, rows: int) -> Array:
    """Simulate `rows` rows of the paper's experiment and return q, (rows, 2)."""
    model = experiment.arm.model
    data = model.createData()
    h, horizon = experiment.step, horizon_of(experiment.duration)
    q, v = np.array(experiment.q0), np.array(experiment.v0)
    kp, ki, kd = (np.array(k) for k in (controller.kp, controller.ki, controller.kd))
    gamma, k0, k1 = (float(x) for x in (controller.learning_rate, controller.k0, controller.k1))
    integral_term = FractionalDerivative(
        1 - controller.integral_order, controller.design, h, horizon
    )
    derivative_term = FractionalDerivative(
        controller.derivative_order, controller.design, h, horizon
    )
    integral = np.zeros(2)
    last_e, last_rate = None, None
    angles = np.empty((rows, 2))
    amplitude, frequency = np.array([0.4, 0.6]), 5 * math.pi
    for k in range(rows):
        t = k * h
        angles[k] = q
        e = math.sin(t) - q
        rate = math.cos(t) - v
        if last_e is not None:
            integral = integral + h * (e + last_e) / 2 + h * h * (last_rate - rate) / 12
        last_e, last_rate = e, rate
        i_term = integral_term.update(integral, e)
        d_term = derivative_term.update(e, rate)
        u = kp * e + ki * i_term + kd * d_term
        s = rate + k1 * e + k0 * integral
        gain = h * gamma * s
        kp = kp + gain * e
        ki = ki + gain * i_term
        kd = kd + gain * d_term
        tau = u + amplitude * math.cos(frequency * t)
        v = v + h * pin.aba(model, data, q, v, tau)
        q = q + h * v
    return angles
