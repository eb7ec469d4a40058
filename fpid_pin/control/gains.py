"""Gains for an arm that nobody has tuned yet, and how far adaptation may raise them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.observer_bandwidth import with_model
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.control.sampled import critical_derivative
from fpid_pin.exceptions import FpidWarning
from fpid_pin.fractional import Design, ExponentialSum

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Part of the sampled-data bound that gains may be raised to, and part that they start within.
CEILING_PART, START_PART = 0.5, 0.25
#: Error that dry friction may cost before the integral answers, rad.
FRICTION_ERROR = 0.09
#: Error that the largest weight torque may cost before the integral answers, rad.
WEIGHT_ERROR = 0.5
#: Error at which the proportional term alone may ask for the whole effort limit, rad.
EFFORT_ERROR = 0.05
#: Error that adaptation takes for large, rad, and the time in which it then doubles a gain, s.
LEARNING_ERROR, LEARNING_TIME = 0.05, 5.0
#: How much adaptation may raise a gain, where the sampled loop allows, and lower it.
RAISE, LOWER = 4.0, 0.5


@dataclass(frozen=True, eq=False)
class GainCeilings:
    """How far the gains of a law may rise on an arm, (n,), in the law's own units.

    Attributes
    ----------
    kp
        Where the damping ratio of the joint's law falls to 1/4 of the present one, at present Kd.
    ki
        Half of Routh's bound for the present Kp and Kd (s^3 + Kd s^2 + Kp s + Ki at orders 1,
        carried over to others at the frequency sqrt(Kp)).
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


def seeded_poses(arm: Arm, poses: int, seed: int) -> FloatArray:
    """Return the home pose and others drawn within the limits (a turn where none), (poses, n)."""
    rng = np.random.default_rng(seed)
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    return np.vstack([arm.home, rng.uniform(low, high, (poses - 1, arm.n))])


class _Mobility:
    """(M + h F_v)^-1 over many poses: what a torque does to the speeds within one step."""

    def __init__(self, arm: Arm, step: float, poses: int, seed: int) -> None:
        self.poses = seeded_poses(arm, poses, seed)
        inertia = np.array([arm.mass_matrix(q) for q in self.poses])
        self.inverse = np.linalg.inv(inertia + step * np.diag(arm.viscous_friction))
        self.least_inertia = (1.0 / np.diagonal(self.inverse, axis1=1, axis2=2)).min(axis=0)
        self.largest_inertia = np.diagonal(inertia, axis1=1, axis2=2).max(axis=0)

    def load(self, kd: FloatArray, critical: FloatArray) -> tuple[float, int]:
        """Return how much of the bound Kd (N m s^mu/rad) uses up, and at which pose most.

        The loop is stable where lambda_max((M + h F_v)^-1 diag(Kd_j/critical_j)) < 1, critical_j
        being what a joint of inertia 1 bears. The product is similar to a symmetric matrix.
        """
        root = np.sqrt(kd / critical)
        largest = np.linalg.eigvalsh(root[:, np.newaxis] * self.inverse * root)[:, -1]
        worst = int(np.argmax(largest))
        return float(largest[worst]), worst


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

    The derivative term limits: over one step its torque changes the speeds by h M^-1 Kd s D^mu e',
    and beyond a certain gain each step overshoots the last. With Kcrit_j what a joint of inertia 1
    bears at its order (2/h at mu = 1),

        lambda_max((M + h F_v)^-1 diag(Kd_j s_j/Kcrit_j)) < 1

    over all poses; M_jj alone is not safe, since the light joints feel less than their M_jj.

    Parameters
    ----------
    arm, controller
        The nominal arm and the law whose present gains give the proportions.
    step, horizon
        Of the sampled loop [s].
    poses, seed
        How many poses to look at (the first is home), and what draws them.
    """
    checks.instance("controller", controller, AdaptiveFpid, "an AdaptiveFpid")
    n = arm.n
    kp, kd, lam, mu = (
        checks.per_joint(name, getattr(controller, name), n)
        for name in ("kp", "kd", "integral_order", "derivative_order")
    )
    scale = controller.scale_on(arm)
    mobility = _Mobility(arm, step, checks.integer("poses", poses, low=1), seed)
    critical = _critical(controller.design, mu, step, horizon)
    load, worst = mobility.load(kd * scale, critical)
    limit = kd / load if load > 0.0 else np.full(n, np.inf)
    damping = kd + arm.viscous_friction / scale
    natural = np.sqrt(np.maximum(kp, 1e-12))
    # At the frequency w, D^mu has the size w^mu and I^lambda that of w^-lambda.
    routh = kp * damping * natural ** (lam - 1.0) * natural ** (mu - 1.0)
    return GainCeilings(
        kp=checks.read_only(16.0 * kp),
        ki=checks.read_only(0.5 * routh),
        kd=checks.read_only(CEILING_PART * limit),
        kd_limit=checks.read_only(limit),
        pose=checks.read_only(mobility.poses[worst]),
    )


def suggest_gains(
    arm: Arm,
    bandwidth: float = 10.0,
    *,
    integral_order: float = 0.9,
    derivative_order: float = 0.95,
    adaptive: bool = True,
    feedforward: bool = False,
    observer: float | str = 0.0,
    step: float = 1e-3,
    horizon: float = 3600.0,
    name: str = "",
) -> AdaptiveFpid:
    """Return an adaptive FPID that follows slow references on `arm` without any tuning.

    Parameters
    ----------
    arm
        The nominal arm.
    bandwidth
        w [rad/s]; ten times the fastest motion that is asked for is a good start.
    integral_order, derivative_order
        lambda and mu.
    adaptive
        False: the same gains, fixed.
    feedforward, observer
        See `AdaptiveFpid`; the observer may be ``"suggested"``: see `suggest_observer`.
    step, horizon
        Of the sampled loop [s].
    name
        What tables and figures call it.

    Returns
    -------
    AdaptiveFpid
        With gains over the scale ``s_j = M_jj + F_v/w + F_d/(0.09 rad w^2) + max|G_j|/(0.5 rad
        w^2)`` (never so large that 0.05 rad of error alone ask for the effort limit), Kp = w^2,
        and Kd, Ki that at the frequency w weigh as 2 w and 0.3 w^3 do at orders 1. Kd is lowered
        where it would use up more than a quarter of the sampled-data bound of `gain_ceilings`.
        Projection keeps adapted gains between half and four times these, under the ceilings;
        learning rates make 0.05 rad of error double a gain in about five seconds.

    Warns
    -----
    FpidWarning
        Joints whose effort limit does not carry the arm at home, or does not overcome their dry
        friction: no gains can make them follow.
    """
    w = checks.number("bandwidth", bandwidth, above=0.0)
    step = checks.number("step", step, above=0.0)
    for reason in impossible_joints(arm):
        warnings.warn(reason, FpidWarning, stacklevel=2)
    design = ExponentialSum(modes=24)
    mobility = _Mobility(arm, step, 200, 0)
    weight = np.max([np.abs(arm.gravity_vector(q)) for q in mobility.poses], axis=0)
    inertia = np.diag(arm.mass_matrix(arm.home))
    scale = inertia + arm.viscous_friction / w + arm.dry_friction / (FRICTION_ERROR * w**2)
    scale = scale + weight / (WEIGHT_ERROR * w**2)
    scale = np.minimum(scale, np.maximum(arm.effort_limit / (EFFORT_ERROR * w**2), 1e-9))

    kp = np.full(arm.n, w**2)
    ki = np.full(arm.n, 0.3 * w**3 * w ** (integral_order - 1.0))
    kd = np.full(arm.n, 2.0 * w * w ** (1.0 - derivative_order))
    mu = np.full(arm.n, derivative_order)
    critical = _critical(design, mu, step, horizon)
    kd = _within_bound(kd * scale, mobility, critical) / scale

    first = AdaptiveFpid(
        kp=kp, ki=ki, kd=kd, integral_order=integral_order, derivative_order=derivative_order,
        learning_rate=0.0, scale=scale, design=design, name=name,
    )  # fmt: skip
    first = with_model(first, arm, feedforward=feedforward, observer=observer, step=step)
    if not adaptive:
        return first
    ceilings = gain_ceilings(arm, first, step=step, horizon=horizon)
    initial = np.stack([kp, ki, kd])
    ceiling = np.stack([ceilings.kp, ceilings.ki, ceilings.kd])
    highest = np.maximum(np.minimum(RAISE * initial, ceiling), initial)
    k1 = float(np.asarray(first.k1))
    # S phi is about k1 e^2 for Kp; I^lambda e counts like e held for a second; e' like w e.
    strength = k1 * LEARNING_ERROR**2 * LEARNING_TIME * np.array([[1.0], [1.0], [w**2]])
    return AdaptiveFpid(
        kp=kp, ki=ki, kd=kd, integral_order=integral_order, derivative_order=derivative_order,
        learning_rate=initial / strength, scale=scale, design=design, name=name,
        safeguards=Safeguards(minimum=LOWER * initial, maximum=highest),
        feedforward=feedforward, observer=first.observer,
    )  # fmt: skip


def impossible_joints(arm: Arm) -> list[str]:
    """Return a line for every joint that its drive cannot move at home, whatever the gains."""
    found = []
    weight = np.abs(arm.gravity_vector(arm.home))
    for j, joint in enumerate(arm.joint_names):
        limit = arm.effort_limit[j]
        if weight[j] > limit:
            found.append(
                f"{arm.name}: joint {joint}: gravity at home is {weight[j]:.3g} N m, beyond its "
                f"effort limit of {limit:.3g} N m; it cannot hold the arm there"
            )
        if limit <= arm.dry_friction[j]:
            found.append(
                f"{arm.name}: joint {joint}: dry friction of {arm.dry_friction[j]:.3g} N m is not "
                f"below its effort limit of {limit:.3g} N m; it cannot be moved"
            )
    return found


def _critical(design: Design, mu: FloatArray, step: float, horizon: float) -> FloatArray:
    found = {
        order: critical_derivative(design, order, step=step, horizon=horizon)
        for order in {float(order) for order in mu}
    }
    return np.array([found[float(order)] for order in mu])


def _within_bound(kd: FloatArray, mobility: _Mobility, critical: FloatArray) -> FloatArray:
    """Lower the Kd (N m s^mu/rad) of the joints that feel least inertia until the bound allows.

    A joint's share is measured by the least inertia that it feels at any pose; the largest common
    share that stays within `START_PART` of the bound is found by bisection.
    """
    if mobility.load(kd, critical)[0] <= START_PART:
        return kd
    share = mobility.least_inertia * critical
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        if mobility.load(np.minimum(kd, middle * share), critical)[0] > START_PART:
            high = middle
        else:
            low = middle
    return np.asarray(np.minimum(kd, low * share))
