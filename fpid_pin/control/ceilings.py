"""How far the gains of a sampled loop may rise: the bound on Kd, and ceilings for adaptation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.poses import seeded_poses, worst_pose
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.sampled import critical_derivative

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Part of the sampled-data bound that gains may be raised to.
CEILING_PART = 0.5


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

    def shares(self, kd: FloatArray, q: FloatArray) -> tuple[float, FloatArray]:
        """Return how much of the bound Kd (N m s^mu/rad), scale included, uses up at a pose.

        Also what part of that is each joint's, (n,): its derivative by ln Kd, over itself.
        """
        # The product is similar to a symmetric matrix.
        root = np.sqrt(kd / self.critical)
        values, vectors = np.linalg.eigh(root[:, np.newaxis] * self.mobility(q) * root)
        return float(values[-1]), np.asarray(vectors[:, -1] ** 2)

    def worst(self, kd: FloatArray) -> tuple[float, FloatArray]:
        """Return the largest load that is found, and its pose; one pose alone is not searched."""
        if not kd.any():
            return 0.0, self.poses[0]
        root = np.sqrt(kd / self.critical)
        loads = np.linalg.eigvalsh(root[:, np.newaxis] * self._mobility * root)[:, -1]
        starts = self.poses[np.argsort(-loads)[:2]]
        if len(self.poses) == 1:
            return float(loads[0]), self.poses[0]
        load, pose = worst_pose(self.arm, lambda q: self.shares(kd, q)[0], starts)
        # Where one Kd is worst another is not far from it.
        self.poses = np.vstack([self.poses, pose])
        self._mobility = np.concatenate([self._mobility, self.mobility(pose)[np.newaxis]])
        return load, pose


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
    return ceilings_within(bound, controller)


def ceilings_within(bound: DerivativeBound, controller: AdaptiveFpid) -> GainCeilings:
    """Return the ceilings of a controller on the arm of a bound on its Kd."""
    arm, scale = bound.arm, controller.scale_on(bound.arm)
    kp, ki, kd = controller_gains(controller, arm.n)
    load, pose = bound.worst(kd * scale)
    limit = kd / load if load > 0.0 else np.full(arm.n, np.inf)
    least = np.stack([kp, ki, kd])
    if controller.safeguards is not None:
        least = np.minimum(least, Safeguards.bounds_of(controller.safeguards, arm.n)[0])
    orders = controller.orders(arm.n)
    natural = np.sqrt(np.maximum(kp, 1e-12))
    damping = least[2] + arm.viscous_friction / scale
    # At the frequency w, D^mu has the size w^mu and I^lambda that of w^-lambda.
    routh = least[0] * damping * natural ** (orders[1] + orders[0] - 2.0)
    return GainCeilings(
        kp=checks.read_only(16.0 * kp),
        ki=checks.read_only(0.5 * routh),
        kd=checks.read_only(CEILING_PART * limit),
        kd_limit=checks.read_only(limit),
        pose=checks.read_only(pose),
    )


def controller_gains(controller: AdaptiveFpid, n: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return Kp, Ki and Kd of a controller on n joints, (n,) each."""
    kp, ki, kd = (checks.per_joint(k, getattr(controller, k), n) for k in ("kp", "ki", "kd"))
    return kp, ki, kd
