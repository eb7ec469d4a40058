"""Loops written out for one robot: Pinocchio called by hand, sums over the whole past.

Nothing here is of the package but the arm's description. A law has `torque(x)`, of which a tick's
numbers are x's attributes, and may have `model(x)` and `adapt(x)`; all numbers are (n,).
"""

import math

import numpy as np
import pinocchio as pin


class Loop:
    """A law with what every law has: integral, scale, feedforward, observer, effort limits.

    Parameters
    ----------
    arm
        The nominal arm.
    law
        One of those below.
    step
        [s].
    scale, feedforward, observer
        As `Controller` has them; the scale as a number or (n,).
    """

    def __init__(self, arm, law, step, *, scale=1.0, feedforward=False, observer=0.0):
        self.arm, self.law, self.h, self.scale = arm, law, step, scale
        self.n, self.viscous, self.limit = arm.n, arm.viscous_friction, arm.effort_limit
        self.feedforward, self.observer, self.bandwidth = feedforward, observer, observer
        self._model, self._data = arm.model, arm.model.createData()
        self.total, self.cut, self.xi = np.zeros(self.n), np.zeros(self.n), np.zeros(self.n)
        self.last = self.predicted = None

    def rnea(self, q, v, a):
        return pin.rnea(self._model, self._data, q, v, a)

    def mass(self):
        upper = np.triu(pin.crba(self._model, self._data, self.q))
        return upper + np.triu(upper, 1).T

    def gravity(self):
        return pin.computeGeneralizedGravity(self._model, self._data, self.q).copy()

    def coriolis(self, w):
        return pin.computeCoriolisMatrix(self._model, self._data, self.q, self.v) @ w

    def torque(self, q, v, q_ref, v_ref, a_ref):
        h = self.h
        self.q, self.v, self.q_ref, self.v_ref, self.a_ref = q, v, q_ref, v_ref, a_ref
        self.e, self.rate, self.v_hat = q_ref - q, v_ref - v, v
        held = self.is_held()
        if self.last is not None and not held:
            e_, rate_ = self.last
            growth = 0.5 * h * (self.e + e_) + h * h / 12.0 * (rate_ - self.rate)
            # Held where the torque was cut and more would be asked for.
            self.total = self.total + np.where(self.cut * self.e > 0.0, 0.0, growth)
        self.last = self.e, self.rate
        u = self.scale * self.law.torque(self)
        if hasattr(self.law, "model"):
            u = u + self.law.model(self)
        if self.feedforward:
            u = u + self.rnea(q_ref, v_ref, a_ref) + self.viscous * v_ref
        if self.bandwidth:
            self._correct()
        if self.observer:
            u = u - self.felt() @ self.xi
        given = self.supervised(u, self.limited(u))
        if self.bandwidth:
            self.predicted = self.v_hat + h * self.ahead(given)
        if hasattr(self.law, "adapt") and not held:
            self.law.adapt(self)
        return given

    def is_held(self):
        """Return whether integrals and gains stand still; nothing here makes them."""
        return False

    def supervised(self, asked, given):
        """Return the torque with what a supervisor adds; here there is none."""
        return given

    def limited(self, asked):
        given = np.clip(asked, -self.limit, self.limit)
        self.cut = asked - given
        return given

    def ahead(self, torque):
        """Return q'' under a torque, disturbances as estimated."""
        bias = self.rnea(self.q, self.v_hat, np.zeros(self.n)) + self.viscous * self.v
        return np.linalg.solve(self.felt(), torque - bias) + self.xi

    def felt(self):
        """What a torque meets over a step: friction is implicit in the speed, as in the arm's."""
        return self.mass() + self.h * np.diag(self.viscous)

    def _correct(self):
        p = np.exp(-self.bandwidth * self.h)
        if self.predicted is not None:
            miss = self.v - self.predicted
            self.v_hat = self.predicted + (1.0 - p**2) * miss
            self.xi = self.xi + (1.0 - p) ** 2 / self.h * miss


def simulate(loop, plant, sample, q, v, rows, push=lambda t: 0.0):
    """Return angles and torques, (rows, n): semi-implicit Euler, viscous friction implicit.

    `plant` is the true arm, `sample(t)` the reference's q, v, a, and `push(t)` a disturbance.
    """
    model, h, viscous = plant.model.copy(), loop.h, plant.viscous_friction
    model.armature = np.array(model.armature) + h * viscous
    data = model.createData()
    angles, torques = [], []
    for k in range(rows):
        u = loop.torque(q, v, *sample(k * h))
        angles.append(q)
        torques.append(u)
        v = v + h * pin.aba(model, data, q, v, u + push(k * h) - viscous * v)
        q = q + h * v
    return np.array(angles), np.array(torques)


class Pid:
    """The PID, by itself or beside the weight."""

    def __init__(self, kp, ki, kd):
        self.kp, self.ki, self.kd = kp, ki, kd

    def torque(self, x):
        return self.kp * x.e + self.ki * x.total + self.kd * x.rate


class PdGravity(Pid):
    def model(self, x):
        return x.gravity()


class GravityOnly:
    def torque(self, x):
        return np.zeros(x.n)

    def model(self, x):
        return x.gravity()


class ComputedTorque(GravityOnly):
    def __init__(self, k0, k1, ki):
        self.k0, self.k1, self.ki = k0, k1, ki

    def model(self, x):
        return x.rnea(x.q, x.v, x.a_ref + self.k1 * x.rate + self.k0 * x.e + self.ki * x.total)


class SlidingMode:
    def __init__(self, slope, gain, layer):
        self.slope, self.gain, self.layer = slope, gain, layer

    def torque(self, x):
        return -self.gain * np.clip((x.v - x.v_ref - self.slope * x.e) / self.layer, -1.0, 1.0)

    def model(self, x):
        w, a = x.v_ref + self.slope * x.e, x.a_ref + self.slope * x.rate
        return x.mass() @ a + x.coriolis(w) + x.gravity()


class SlotineLi:
    """With Pinocchio's regressor, theta in Pinocchio's own frames and order, (10 n)."""

    def __init__(self, arm, slope, damping, rate, initial, leakage):
        self.slope, self.damping, self.leakage = slope, damping, leakage
        self.model_, self.data = arm.model, arm.model.createData()
        bodies = list(arm.model.inertias)[1:]
        self.start = initial * np.concatenate([b.toDynamicParameters() for b in bodies])
        mass = np.array([b.mass for b in bodies])
        spin = np.array([np.trace(b.inertia) / 2.0 + b.mass * b.lever @ b.lever for b in bodies])
        reach = np.sqrt(spin / mass)
        sizes = [mass, *3 * [mass * reach], *6 * [mass * reach**2]]
        self.rates = rate * np.array(sizes).T.reshape(-1) ** 2
        inertia = np.triu(pin.crba(self.model_, self.data, arm.home)).diagonal()
        friction = np.maximum(inertia, np.maximum(arm.viscous_friction, arm.dry_friction))
        self.friction_rate = rate * friction**2
        self.theta, self.friction = self.start.copy(), np.zeros((2, arm.n))

    def regressor(self, q, v, w, a):
        """C(q, v) w is bilinear and symmetric: of (v + w)/2 less that of (v - w)/2."""

        def y(v, a):
            return pin.computeJointTorqueRegressor(self.model_, self.data, q, v, a).copy()

        still = np.zeros_like(v)
        return y((v + w) / 2.0, a) - y((v - w) / 2.0, still) + y(still, still)

    def torque(self, x):
        self.w, a = x.v_ref + self.slope * x.e, x.a_ref + self.slope * x.rate
        self.s, self.smooth = x.v - self.w, np.tanh(self.w / 0.05)
        self.y = self.regressor(x.q, x.v, self.w, a)
        return -self.damping * self.s

    def model(self, x):
        rotors = np.array(self.model_.armature) * (x.a_ref + self.slope * x.rate)
        return self.y @ self.theta + rotors + (self.friction * [self.w, self.smooth]).sum(axis=0)

    def adapt(self, x):
        s = np.where(x.cut * -self.s > 0.0, 0.0, self.s)
        leak = self.leakage * (self.theta - self.start)
        self.theta = self.theta - x.h * (self.rates * (self.y.T @ s) + leak)
        regressors = np.stack([self.w, self.smooth])
        moved = self.friction_rate * regressors * s + self.leakage * self.friction
        self.friction = self.friction - x.h * moved


class L1:
    """D^alpha of f, its rate constant between samples, over the whole past; alpha is a number."""

    def __init__(self, alpha, h, rows):
        i = np.arange(rows + 1.0)
        self.weights = h**-alpha * np.diff(i ** (1.0 - alpha)) / math.gamma(2.0 - alpha)
        self.changes, self.last = [], None

    def __call__(self, f):
        if self.last is not None:
            self.changes.append(f - self.last)
        self.last = f
        if not self.changes:
            return np.zeros_like(f)
        return self.weights[: len(self.changes)][::-1] @ np.array(self.changes)


class PiecewiseLinear:
    """I^order of f, straight between samples, over the whole past (Diethelm, Ford, Freed, 2004)."""

    def __init__(self, order, h, rows):
        self.order, self.past = order, []
        self.factor = h**order / math.gamma(order + 2.0)

    def __call__(self, f):
        self.past.append(f)
        k, a = len(self.past) - 1, self.order
        if k == 0:
            return np.zeros_like(f)
        i = np.arange(k - 1.0, 0.0, -1.0)
        middle = (i + 1.0) ** (a + 1.0) - 2.0 * i ** (a + 1.0) + (i - 1.0) ** (a + 1.0)
        first = (k - 1.0) ** (a + 1.0) - (k - 1.0 - a) * float(k) ** a
        return self.factor * (np.array([first, *middle, 1.0]) @ np.array(self.past))


class Fpid:
    """Eqs. (10), (22) and (30)-(32): orders 1, or `fractional(f, f')` of f = (int e, e)."""

    def __init__(self, gains, rates, k0=1.0, k1=2.0, fractional=None, regressors="law"):
        self.gains, self.rates, self.k0, self.k1 = gains, rates, k0, k1
        self.fractional, self.regressors = fractional, regressors

    def torque(self, x):
        terms = integer = x.e, x.total, x.rate
        if self.fractional is not None:
            f, slope = np.concatenate([x.total, x.e]), np.concatenate([x.e, x.rate])
            terms = x.e, *np.split(self.fractional(f, slope), 2)
        self.phi = terms if self.regressors == "law" else integer
        self.s = -(x.rate + self.k1 * x.e + self.k0 * x.total)
        return sum(gain * term for gain, term in zip(self.gains, terms, strict=True))

    def adapt(self, x):
        free = x.cut * -self.s <= 0.0
        self.gains = [
            np.where(free, gain - x.h * (rate * self.s * term), gain)
            for gain, rate, term in zip(self.gains, self.rates, self.phi, strict=True)
        ]
