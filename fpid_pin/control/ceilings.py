"""How far gains may rise in a sampled loop: the bound on Kd over poses, and ceilings."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.poses import (
    STARTS,
    gravity_instability,
    heaviness,
    inertia_slope,
    seeded_poses,
    worst_pose,
)
from fpid_pin.control.stability import critical_gain, frequencies
from fpid_pin.fractional import Design
from fpid_pin.fractional.design import modes_of
from fpid_pin.resources import one_blas_thread

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Part of the sampled-data bound that Kd may be raised to: a gain margin of 2, the usual least one
#: (Åström and Murray, *Feedback Systems*, 2008, section 9.3).
CEILING_PART = 0.5
#: Factor of Kp at which, Kd as it is, the damping ratio Kd/(2 sqrt(Kp)) falls to a quarter.
CEILING_KP = 16.0


@dataclass(frozen=True, eq=False)
class GainCeilings:
    """How far the gains of a law may rise on an arm, (n,), in the law's own units.

    Attributes
    ----------
    kp
        Where the damping ratio of the joint's law falls to 1/4 of the present one, at present Kd.
    ki
        Half of Routh's bound for the lowest Kp and Kd (s^3 + Kd s^2 + Kp s + Ki at orders 1,
        carried over to others at the frequency sqrt(Kp)): those of the law's safeguards, if it has
        any, else the present ones.
    kd
        Half of the sampled-data bound.
    kd_limit
        The bound itself: all Kd raised together in their present proportion, the loop of the
        worst pose breaks here.
    pose
        That pose, (n,) [rad].
    """

    kp: FloatArray
    ki: FloatArray
    kd: FloatArray
    kd_limit: FloatArray
    pose: FloatArray


class DerivativeBound:
    """How much Kd the sampled loop bears over the poses of an arm.

    A derivative term's torque changes the speeds by -h (M + h F_v)^-1 Kd D^mu q' within a step,
    friction by -h (M + h F_v)^-1 F_v q'. At orders 1 the loop of these two is stable where

        lambda_max((M + h F_v/2)^-1 diag(Kd_j/critical_j)) < 1,   critical = 2/h

    so a joint bears 2 M/h + F_v: where friction stops it within a step (h F_v >> M) half of what
    (M + h F_v) suggests. Lower orders have a larger `critical`. M_jj alone is not safe, since light
    joints feel less than their M_jj.
    """

    def __init__(
        self, arm: Arm, controller: AdaptiveFpid, *, step: float, horizon: float,
        poses: int = 200, seed: int = 0,
    ) -> None:  # fmt: skip
        mu = controller.orders(arm.n)[1].tolist()
        found = {
            order: critical_derivative(controller.design, order, step=step, horizon=horizon)
            for order in set(mu)
        }
        self.critical = np.array([found[order] for order in mu])
        self.arm, self._friction = arm, 0.5 * step * np.diag(arm.viscous_friction)
        self.poses = seeded_poses(arm, poses, seed)
        self._mobility = np.array([self.mobility(q) for q in self.poses])

    def mobility(self, q: FloatArray) -> FloatArray:
        """Return (M + h F_v/2)^-1 at a pose, (n, n)."""
        return np.asarray(np.linalg.inv(self.arm.mass_matrix(q) + self._friction))

    def load_at(self, kd: FloatArray, q: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        """Return which part of the bound Kd [N m s^mu/rad], scale included, uses up at a pose.

        Also which part of that is each joint's, (n,): its derivative by ln Kd, over itself; and its
        derivative by q, (n,).
        """
        # The product is similar to a symmetric matrix.
        root, mobility = np.sqrt(kd / self.critical), self.mobility(q)
        values, vectors = np.linalg.eigh(root[:, np.newaxis] * mobility * root)
        moved = mobility @ (root * vectors[:, -1])
        return float(values[-1]), vectors[:, -1] ** 2, -inertia_slope(self.arm, q, moved)

    def worst(self, kd: FloatArray) -> tuple[float, FloatArray]:
        """Return the largest load that is found, and its pose; one pose alone is not searched."""
        if not kd.any():
            return 0.0, self.poses[0]
        root = np.sqrt(kd / self.critical)
        loads = np.linalg.eigvalsh(root[:, np.newaxis] * self._mobility * root)[:, -1]
        if len(self.poses) == 1:
            return float(loads[0]), self.poses[0]
        starts = self.poses[np.argsort(-loads)[:STARTS]]
        load, pose = worst_pose(self.arm, lambda q: self.load_at(kd, q)[::2], starts)
        # Where one Kd is worst another is not far from it.
        self.poses = np.vstack([self.poses, pose])
        self._mobility = np.concatenate([self._mobility, self.mobility(pose)[np.newaxis]])
        return load, pose

    def critical_poses(self, scale: FloatArray) -> FloatArray:
        """Return poses at which a loop with equal gains over a scale is likeliest to break, (7, n).

        They are home; where the arm is heaviest, where gravity is most unstable (M and dG/dq over
        the scale s_j, (n,)), and where it is lightest, searched for; and three seeded ones.
        """
        poses = seeded_poses(self.arm, 200, 0)
        found = [
            worst_pose(self.arm, lambda q, f=f: f(self.arm, scale, q), poses)[1]  # type: ignore[misc]
            for f in (heaviness, gravity_instability)
        ]
        return np.vstack([self.arm.home, *found, self.worst(scale)[1], poses[1:4]])

    def ceilings(self, controller: AdaptiveFpid) -> GainCeilings:
        """Return how far the gains of a controller may rise."""
        arm, scale = self.arm, controller.scale_on(self.arm)
        gains = least = gain_table(controller, arm.n)
        kp, _, kd = gains
        load, pose = self.worst(kd * scale)
        limit = kd / load if load > 0.0 else np.full(arm.n, np.inf)
        if controller.safeguards is not None:
            least = np.minimum(gains, Safeguards.bounds_of(controller.safeguards, arm.n)[0])
        natural = np.sqrt(np.maximum(kp, 1e-12))
        damping = least[2] + arm.viscous_friction / scale
        # At the frequency w, D^mu has the size w^mu and I^lambda that of w^-lambda.
        routh = least[0] * damping * natural ** (controller.orders(arm.n).sum(axis=0) - 2.0)
        found = (CEILING_KP * kp, 0.5 * routh, CEILING_PART * limit, limit, pose)
        return GainCeilings(*map(checks.read_only, found))


def critical_derivative(design: Design, order: float, *, step: float, horizon: float) -> float:
    """Return the Kd at which ``Kd D^mu`` alone makes a joint of inertia 1 unstable.

    The joint moves as the simulation has it. With mu = 1 this is 2/h, reached at Nyquist's
    frequency; a lower order lags, so its loop breaks at a lower frequency, near mu pi/h.
    """
    z = np.exp(1j * frequencies(step, lowest=1e-2 / step) * step)
    operator = modes_of(design, order, step=step, horizon=horizon).recursion().response(1.0 / z)
    speed = step / (z - 1.0)
    loop = speed * (operator[:, 0] * step * z / (z - 1.0) + operator[:, 1])
    found = critical_gain(np.asarray(loop, np.complex128))
    return float(found.min()) if found.size else np.inf


@one_blas_thread()
def gain_ceilings(
    arm: Arm,
    controller: AdaptiveFpid,
    *,
    step: float = 1e-3,
    horizon: float = 3600.0,
    poses: int = 200,
    seed: int = 0,
) -> GainCeilings:
    """Return how far adaptation may raise the gains of `controller` on `arm`.

    Parameters
    ----------
    arm, controller
        The nominal arm and the law whose present gains give the proportions.
    step, horizon
        Of the sampled loop [s].
    poses, seed
        How many poses to look at (the first is home), and what draws them. The worst of several
        are starts of a search for the worst there is; see `DerivativeBound`.
    """
    checks.instance("controller", controller, AdaptiveFpid, "an AdaptiveFpid")
    poses = checks.integer("poses", poses, low=1)
    bound = DerivativeBound(arm, controller, step=step, horizon=horizon, poses=poses, seed=seed)
    return bound.ceilings(controller)


def gain_table(controller: AdaptiveFpid, n: int) -> FloatArray:
    """Return Kp, Ki and Kd of a controller on n joints, (3, n), its scale left out."""
    return np.stack([checks.per_joint(k, getattr(controller, k), n) for k in ("kp", "ki", "kd")])
