"""Slotine and Li's regressor from Pinocchio's, and the natural size of inertial parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Reference speed below which dry friction counts as smooth, rad/s: a few times what an encoder
#: resolves, so that the estimate's torque does not chatter where v_r crosses zero.
FRICTION_SPEED = 0.05


class Regressor:
    """Y(q, v, w, a), (runs, n, 12 n), with Y theta = M a + C(q, v) w + G + F_v w + F_d sgn(w).

    theta holds the ten inertial parameters of each link, then F_v and F_d of each joint. Rotor
    inertia is not among them: its torque is `rotor`.

    Pinocchio's joint torque regressor has one velocity for both places. C(q, v) w is bilinear and
    symmetric in v and w, so with c(x) = C(q, x) x it is c((v + w)/2) - c((v - w)/2), exactly: one
    regressor with gravity minus one without.

    Parameters
    ----------
    arm
        The nominal arm.
    runs
        Number of runs.
    """

    def __init__(self, arm: Arm, runs: int) -> None:
        self._n = arm.n
        self._model = arm.model.copy()
        self._weightless = arm.model.copy()
        self._weightless.gravity.linear = np.zeros(3)
        self._data, self._data_weightless = self._model.createData(), self._model.createData()
        self._armature = arm.armature
        self._rest = np.zeros(arm.n)
        self._joints = np.arange(arm.n)
        self.value: FloatArray = np.zeros((runs, arm.n, 12 * arm.n))
        self.rotor: FloatArray = np.zeros((runs, arm.n))

    def update(self, q: FloatArray, v: FloatArray, w: FloatArray, a: FloatArray) -> FloatArray:
        """Evaluate Y at (runs, n) arrays and return it; its own buffer."""
        n, y = self._n, self.value
        mean, half = 0.5 * (v + w), 0.5 * (v - w)
        for run in range(len(y)):
            full = pin.computeJointTorqueRegressor(
                self._model, self._data, q[run], mean[run], a[run]
            )
            part = pin.computeJointTorqueRegressor(
                self._weightless, self._data_weightless, q[run], half[run], self._rest
            )
            np.subtract(full, part, out=y[run, :, : 10 * n])
        y[:, self._joints, 10 * n + self._joints] = w
        y[:, self._joints, 11 * n + self._joints] = np.tanh(w / FRICTION_SPEED)
        np.multiply(self._armature, a, out=self.rotor)
        return y


def parameter_spread(arm: Arm) -> FloatArray:
    """Return the natural size of each parameter, (12 n,): what "unknown" may mean for it.

    A link of mass m whose matter lies about r from its joint has parameters of the size m, m r
    and m r^2. Friction's size is the arm's own, or at least the torque that turns M_jj at
    1 rad/s^2.
    """
    masses, radii = [], []
    for body in list(arm.model.inertias)[1:]:
        spin = float(np.trace(np.asarray(body.inertia))) / 2.0
        lever = float(np.linalg.norm(body.lever))
        radius = np.sqrt(lever**2 + spin / body.mass) if body.mass > 0.0 else 0.0
        masses.append(body.mass)
        radii.append(radius)
    mass, radius = np.array(masses), np.array(radii)
    # A link without mass of its own may still carry something: take the arm's typical one.
    mass = np.where(mass > 0.0, mass, mass.mean())
    radius = np.where(radius > 0.0, radius, radius.mean())
    links = np.empty((arm.n, 10))
    links[:, 0] = mass
    links[:, 1:4] = (mass * radius)[:, np.newaxis]
    links[:, 4:] = (mass * radius**2)[:, np.newaxis]
    inertia = np.diag(arm.mass_matrix(arm.home))
    friction = np.maximum(inertia, np.maximum(arm.viscous_friction, arm.dry_friction))
    return np.concatenate([links.ravel(), friction, friction])
