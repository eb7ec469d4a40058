"""A box within which gains may move at any speed: what makes an adapting loop stable.

Every gain is K = K0 + r delta, |delta| <= 1 any sequence in time. The deltas close a loop about

    G(z) = diag(r) T(z) (I - E K0 T(z))^-1

from n torques to 3 n terms, T being the open loop from torques to terms and E K0 the law (10): each
term's torque enters its joint. If some constant diagonal D makes ||D G E D^-1|| < 1 on the unit
circle, no sequence destabilises the loop: the small gain theorem, for deltas commute with D
(Khalil, *Nonlinear Systems*, 2002, section 5.4; scalings: Doyle, IEE Proceedings D 129, 1982).
"""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import BoolArray, FloatArray, checked
from fpid_pin.control import linear
from fpid_pin.control.ceilings import DerivativeBound, gain_table
from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.linear import ComplexArray, LinearLaw, LinearSystem
from fpid_pin.resources import one_blas_thread

#: What of the proved reach is used: rounding must not decide.
PART = 0.999
#: Frequencies at first, evenly spread over decades: some 30 a decade, as in a Bode diagram.
FREQUENCIES = 250
#: By how much the bound may exceed the largest norm that is met.
EXCESS = 1.01
#: How often a bound may be raised, and how far from the imaginary axis an eigenvalue, as a part of
#: its size, is still looked at.
ROUNDS, NEAR = 20, 1e-3
#: Powers of the mean that stands for the largest of the norms, one search after another.
POWERS = (10.0, 100.0, 1000.0)


@dataclass(frozen=True, eq=False)
class GainCertificate:
    """A box of gains that may move in it as they like; see `certify_gains`.

    Attributes
    ----------
    controller
        The law, its projection put to the box.
    reach
        How far, as a part of the initial gains times `spread`, each may move either way: the least
        of `reaches`. 0 where the initial gains themselves are unstable at a pose.
    low, high
        The box: least and largest Kp, Ki, Kd, (3, n), in the law's own units.
    poses, reaches
        The poses looked at, (poses, n) [rad], and the reach at each, (poses,).
    """

    controller: AdaptiveFpid
    reach: float
    low: FloatArray
    high: FloatArray
    poses: FloatArray
    reaches: FloatArray

    def __str__(self) -> str:
        return (
            f"gains may move within {100.0 * self.reach:.0f} % of the initial ones, times their "
            f"spread, at any speed; at each of {len(self.poses)} poses: "
            + ", ".join(f"{100.0 * reach:.0f} %" for reach in self.reaches)
        )


@checked
@one_blas_thread()
def certify_gains(
    arm: Arm, controller: AdaptiveFpid, *, spread: ArrayLike = 1.0, step: float = 1e-3,
    horizon: float = 3600.0, poses: ArrayLike | None = None,
) -> GainCertificate:  # fmt: skip
    """Return the widest box around a law's gains in which a proof allows any adaptation.

    Parameters
    ----------
    arm, controller
        The nominal arm, and a law stable on it.
    spread
        Proportions of the box: gains stay within ``K(0) (1 +- reach spread)``; a scalar, (n,) or
        (3, n). 0 for a gain that does not move.
    step, horizon
        Of the sampled loop [s].
    poses
        Where the arm is linearised, (poses, n) [rad]. None: home, where it is heaviest, lightest
        and gravity most unstable, and three random ones.

    Returns
    -------
    GainCertificate
        Proved, for each pose and to rounding: the sampled loop of the arm linearised at rest there
        and of the law with all its modes is exponentially stable for every sequence of gains in the
        box, however fast, and so whatever the learning rates. The condition is sufficient, not
        necessary. An observer changes nothing: on the exact model no torque excites it. Not
        covered: motion between poses, torque limits, dry friction, a wrong model.

    Raises
    ------
    ArgumentError
        A fractional design without modes, orders that adapt, or no gain that may move.
    """
    if np.any(controller.order_learning_rate):
        raise checks.ArgumentError("controller", "orders that stay", "an order_learning_rate")
    step = checks.sampling_step(step)
    n, scale = arm.n, controller.scale_on(arm)
    initial = gain_table(controller, n)
    spread = checks.scalar_or_joints("spread", spread, rows=3, low=0.0)
    if spread.ndim and spread.shape[-1] not in (1, n):
        raise checks.ArgumentError("spread", f"shape ({n},) or (3, {n})", f"shape {spread.shape}")
    width = np.broadcast_to(spread, (3, n)) * initial
    if not width.any():
        raise checks.ArgumentError("spread", "a gain above 0 that may move", "none")
    if poses is None:
        bound = DerivativeBound(arm, controller, step=step, horizon=horizon)
        where = bound.critical_poses(scale)
    else:
        where = np.atleast_2d(checks.floats("poses", poses, max_ndim=2))
        if where.shape[1:] != (n,):
            raise checks.ArgumentError("poses", f"shape (poses, {n})", f"shape {where.shape}")
    table = initial * scale
    terms = linear.linear_terms(controller, arm, step=step, horizon=horizon, used=np.sign(table))
    plants = [linear.linear_arm(arm, q, step=step) for q in where]
    reaches = np.array([_proved_reach(terms, plant, table, width * scale) for plant in plants])
    reach = float(reaches.min())
    low, high = np.maximum(initial - reach * width, 0.0), initial + reach * width
    guards = dataclasses.replace(controller.safeguards or Safeguards(), minimum=low, maximum=high)
    law = dataclasses.replace(controller, safeguards=guards)
    return GainCertificate(law, reach, *map(checks.read_only, (low, high, where, reaches)))


def _proved_reach(
    terms: LinearLaw, plant: LinearSystem, gains: FloatArray, radius: FloatArray
) -> float:
    """Return the part of `radius`, (3, n), by which gains may move at a pose; 0: none is proved."""
    torque, r = linear.feedback(gains), radius.reshape(-1)
    system = terms.open_loop(plant)
    closed = system.closed(torque)
    if np.abs(np.linalg.eigvals(closed)).max() >= 1.0:
        return 0.0

    def response(angle: FloatArray) -> ComplexArray:
        """Return T (I - K0 T)^-1 at angles of z, (K,) [rad], as (K, 3 n, n)."""
        z = np.exp(1j * angle)
        t = terms.response(z) @ plant.response(z)
        return np.asarray(t @ np.linalg.inv(np.eye(len(torque)) - torque @ t))

    lowest = min(0.1 * float((1.0 - terms.decay).min(initial=1.0)), 1e-6)
    found = response(np.geomspace(lowest, np.pi, FREQUENCIES))
    d = best_scaling(r[:, np.newaxis] * found[::3], r > 0.0)
    left, right = (d * r)[:, np.newaxis], joint_factors(d, r > 0.0)
    scaled = LinearSystem(closed, system.b * right, left * system.c)
    most = float(np.linalg.norm(left * found * right, 2, axis=(1, 2)).max())
    return PART / norm_bound(scaled, lambda angle: left * response(angle) * right, most)


def norm_bound(
    system: LinearSystem, response: Callable[[FloatArray], ComplexArray], most: float
) -> float:
    """Return a bound on the norm of a stable system's response over the unit circle.

    It is at most `EXCESS` times the largest norm that is met, and inf where none is found: by
    eigenvalues of Hamiltonian matrices (docs/gains.md). `response` is the system's at angles of z,
    (K,) [rad], as (K, outputs, inputs); `most` is the largest norm known, z = -1 among others.
    """
    # In the variable s of z = (1 + s)/(1 - s).
    eye = np.eye(len(system.a))
    inverse = np.linalg.inv(eye + system.a)
    a, b = inverse @ (system.a - eye), 2.0**0.5 * inverse @ system.b
    c, d = 2.0**0.5 * system.c @ inverse, -system.c @ inverse @ system.b
    for _ in range(ROUNDS):
        gamma = EXCESS * most
        r = np.linalg.inv(gamma**2 * np.eye(d.shape[1]) - d.T @ d)
        own = a + b @ r @ d.T @ c
        lower = -c.T @ (np.eye(len(d)) + d @ r @ d.T) @ c
        s = np.linalg.eigvals(np.block([[own, b @ r @ b.T], [lower, -own.T]]))
        near = np.unique(np.abs(s.imag[np.abs(s.real) < NEAR * np.abs(s)]))
        angle = 2.0 * np.arctan(np.append(near, np.sqrt(near[1:] * near[:-1])))
        most = np.linalg.norm(response(angle), 2, axis=(1, 2)).max(initial=0.0)
        if most < (1.0 - 1e-6) * gamma:
            return gamma
    return np.inf


def best_scaling(response: ComplexArray, used: BoolArray) -> FloatArray:
    """Return D, (3 n), that makes the largest scaled norm of responses, (K, 3 n, n), about least.

    The logarithm of the norm is convex in ln D (Sezginer and Overton, IEEE Transactions on
    Automatic Control 35, 1990); its largest over the points is smoothed by a power mean. `used` are
    the terms whose gains move.
    """
    from scipy.optimize import minimize

    def merit(log_d: FloatArray, power: float) -> tuple[float, FloatArray]:
        d = np.exp(log_d)
        right = joint_factors(d, used)
        u, sizes, v = np.linalg.svd(d[:, np.newaxis] * response * right, full_matrices=False)
        log_size = np.log(sizes[:, 0] + 1e-150)
        weights = np.exp(power * (log_size - log_size.max()))
        # The norm's derivative by the left factors, less that by the right ones: which part of a
        # joint's factor is each term's.
        part = np.where(used, d**-2.0, 0.0) / np.maximum(np.tile(right**2, 3), 1e-300)
        by_d = np.abs(u[:, :, 0]) ** 2 - np.tile(np.abs(v[:, 0]) ** 2, 3) * part
        value = log_size.max() + np.log(weights.sum()) / power
        return float(value), weights @ by_d / weights.sum()

    log_d = np.zeros(response.shape[1])
    for power in POWERS:
        log_d = minimize(merit, log_d, args=(power,), jac=True, method="L-BFGS-B").x
    return np.asarray(np.exp(log_d))


def joint_factors(d: FloatArray, used: BoolArray) -> FloatArray:
    """Return one factor a joint, (n,), for E D^-1: the root of E D^-2 E^T, which is diagonal."""
    return np.asarray(np.sqrt(np.where(used, d**-2.0, 0.0).reshape(3, -1).sum(axis=0)))
