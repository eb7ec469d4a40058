"""How far gains may go in a sampled loop, over poses: ceilings, and boxes that are damped."""

from dataclasses import dataclass
from functools import lru_cache
from itertools import product
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control.fpid import AdaptiveFpid, Safeguards
from fpid_pin.control.linear import feedback, linear_arm, linear_terms
from fpid_pin.control.poses import (
    STARTS,
    gravity_instability,
    heaviness,
    inertia_slope,
    seeded_poses,
    worst_pose,
)
from fpid_pin.control.stability import critical_derivative
from fpid_pin.fractional import ExponentialSum
from fpid_pin.resources import one_blas_thread

#: Part of the sampled-data bound that Kd may be raised to: a gain margin of 2, the usual least one
#: (Åström and Murray, *Feedback Systems*, 2008, section 9.3).
CEILING_PART = 0.5
#: Factor of Kp at which, Kd as it is, the damping ratio Kd/(2 sqrt(Kp)) falls to a quarter.
CEILING_KP = 16.0
#: Below this a pole does not count as oscillating [rad/s]: a minute a period.
SLOW = 0.1
#: Modes of the operators here. Over 200/bandwidth the least damping ratio comes out within some
#: 0.05 of that of 24 modes over an hour, in a tenth of the time.
MODES = 6
#: Damping ratio that a box keeps: room for what lies between the poses and gains that are tried.
BOX_DAMPING = 0.05
#: Gains drawn inside a box: 24 of which none is undamped leave 12 % of it to be so, at 95 %.
INSIDE = 24
#: How often a worse corner is looked for, and the part of a box is halved: to within a sixteenth.
TURNS = 4
#: What a missing bit of damping ratio weighs beside the logarithm of one joint's gains.
PENALTY = 100.0
#: Poles that are watched at a pose: the least damped changes as gains do, and would be a kink.
PAIRS = 4
#: How often poses may be added at which the last gains were found wanting.
ROUNDS = 8
#: Parts of the bandwidth to start from, one after another until less damping than that is missing.
STARTING_PARTS, ENOUGH = (1.0, 0.5, 0.2), 0.1
#: Missing damping ratio, and part of the bound used in excess, that no round is spent on.
SLACK = 0.01


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
        orders, which = np.unique(controller.orders(arm.n)[1], return_inverse=True)
        self.critical = np.array([
            critical_derivative(controller.design, mu, step=step, horizon=horizon) for mu in orders
        ])[which]  # fmt: skip
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

        They are home; where the arm is heaviest, most unstable by gravity (M and dG/dq over the
        scale, (n,)), and lightest, searched for; and three seeded ones.
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


@checked
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
        are starts of a search for the worst there is (docs/gains.md).

    Raises
    ------
    ArgumentError
        Another law; a fractional design without modes.
    """
    step = checks.sampling_step(step)
    checks.integer("poses", poses, low=1)
    checks.integer("seed", seed, low=0)
    bound = DerivativeBound(arm, controller, step=step, horizon=horizon, poses=poses, seed=seed)
    return bound.ceilings(controller)


def gain_table(controller: AdaptiveFpid, n: int) -> FloatArray:
    """Return Kp, Ki and Kd of a controller on n joints, (3, n), its scale left out."""
    return np.stack([checks.per_joint(k, getattr(controller, k), n) for k in ("kp", "ki", "kd")])


class FrozenLoops:
    """The sampled loops of an arm at rest at several poses, (poses, n), under any gains above 0.

    `horizon` [s] should be some 200 over the bandwidth: see `MODES`.
    """

    def __init__(
        self, arm: Arm, law: AdaptiveFpid, poses: FloatArray, *, step: float, horizon: float,
        modes: int = MODES,
    ) -> None:  # fmt: skip
        self.step, self.poses, design = step, poses, ExponentialSum(modes=modes)
        terms = linear_terms(law, arm, step=step, horizon=horizon, design=design)
        self._loops = [terms.open_loop(linear_arm(arm, q, step=step)) for q in poses]

    def damping(self, gains: FloatArray, pose: int) -> float:
        """Return the least damping ratio with Kp, Ki, Kd, (3, n), scale included, at a pose."""
        poles = np.linalg.eigvals(self._loops[pose].closed(feedback(gains)))
        return float(self._ratios(poles).min())

    def ratios(self, gains: FloatArray) -> FloatArray:
        """Return the least damping ratio at every pose, (poses,)."""
        return np.array([self.damping(gains, pose) for pose in range(len(self.poses))])

    def _ratios(self, poles: Any) -> FloatArray:
        """Return the damping ratio -Re(s)/|s| of each pole z = exp(s h).

        Poles that hardly oscillate, |Im s| < `SLOW`, have 1, or -1 outside the unit circle. So have
        those beyond a quarter of the Nyquist frequency: they are the derivative's own, and the
        sampled-data bound sees to them.
        """
        s = np.log(poles + (0j + 1e-300)) / self.step
        size = np.abs(s)
        motion = (np.abs(s.imag) > SLOW) & (size < 0.25 * np.pi / self.step)
        rest = np.where(np.abs(poles) < 1.0, 1.0, -1.0)
        return np.where(motion, -s.real / np.maximum(size, 1e-300), rest)

    def slopes(self, gains: FloatArray, pose: int, count: int = 1) -> tuple[FloatArray, FloatArray]:
        """Return the least damping ratios, (count,), and their derivatives by ln K, (count, 3, n).

        With x and y the right and left eigenvectors of a pole z, dz/dK = y^T b (c x) / y^T x: b of
        the gain's joint, c of its term (Lancaster, Numerische Mathematik 6, 1964).
        """
        loop = self._loops[pose]
        values, right = np.linalg.eig(loop.closed(feedback(gains)))
        ratios = self._ratios(values)
        least = np.argsort(np.where(values.imag >= 0.0, ratios, 2.0))[:count]
        left = np.linalg.solve(right.T, np.eye(len(values))[:, least])
        z = values[least] + 0j
        terms = (loop.c @ right[:, least]).reshape(*gains.shape, count)
        by_torque = loop.b.T @ left / (z * self.step)
        rate = np.moveaxis(gains[:, :, np.newaxis] * terms * by_torque, -1, 0)  # ds/d ln K
        s = (np.log(z) / self.step)[:, np.newaxis, np.newaxis]
        # zeta = -Re s/|s|; a pole that only grows is to grow less.
        turned = s.real * (np.conj(s) * rate).real / np.abs(s) ** 3
        slopes = -rate.real / np.abs(s) + np.where(np.abs(s.imag) > SLOW, turned, 0.0)
        return ratios[least], np.asarray(slopes)


def between(low: FloatArray, high: FloatArray, part: FloatArray) -> FloatArray:
    """Return the gains between low (part 0) and high (1), in ratio."""
    return np.asarray(low ** (1.0 - part) * high**part)


def is_damped(loops: FrozenLoops, low: FloatArray, high: FloatArray) -> bool:
    """Return whether all that is tried in a box of gains keeps `BOX_DAMPING` at every pose."""
    # Corners at which all joints are alike, corners that the damping ratio's derivative points to
    # from the worst of them, and seeded points inside.
    corners = [np.outer(ends, np.ones(low.shape[1])) for ends in product((0.0, 1.0), repeat=3)]
    for pose in range(len(loops.poses)):
        found = [loops.damping(between(low, high, corner), pose) for corner in corners]
        if min(found) < BOX_DAMPING:
            return False
        corner = corners[int(np.argmin(found))]
        for _ in range(TURNS):
            ratio, slope = loops.slopes(between(low, high, corner), pose)
            if ratio[0] < BOX_DAMPING:
                return False
            worse = np.where(slope[0] > 0.0, 0.0, 1.0)
            if np.array_equal(worse, corner):
                break
            corner = worse
    rng = np.random.default_rng(0)
    parts = [(rng.random(low.shape), int(rng.integers(len(loops.poses)))) for _ in range(INSIDE)]
    inside = (loops.damping(between(low, high, part), pose) for part, pose in parts)
    return all(ratio >= BOX_DAMPING for ratio in inside)


def damped_box(
    loops: FrozenLoops, low: FloatArray, initial: FloatArray, high: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Return the largest part of a box around gains that is found damped, and that part.

    All gains are Kp, Ki, Kd, (3, n), scale included. At a part below 1 the box's sides are nearer
    to the gains, in ratio; the low one with the square of the part: it is of less use to
    adaptation, and where gravity is unstable, low Kp is what breaks the loop.
    """

    def sides(part: float) -> tuple[FloatArray, FloatArray]:
        return initial * (low / initial) ** part**2, initial * (high / initial) ** part

    if is_damped(loops, low, high):
        return low, high, 1.0
    most, beyond = 0.0, 1.0
    for _ in range(TURNS):
        middle = 0.5 * (most + beyond)
        most, beyond = (middle, beyond) if is_damped(loops, *sides(middle)) else (most, middle)
    return *sides(most), most


def nearest_gains(
    loops: FrozenLoops, bound: DerivativeBound, wanted: FloatArray, *, part: float,
    damping: FloatArray,
) -> FloatArray:  # fmt: skip
    """Lower gains, (3, n), joint by joint, no further than damping and the bound on Kd ask.

    `part` of the bound may be used up; `damping` is the least ratio at each pose of `loops`. The
    sum of all ln K is made as large as it may be, so that a gain gives up little where another can
    do as much. A pose counts from when gains have been found wanting there. Where nothing
    satisfies all constraints the damping ratios fall short by the same, least, amount.
    """
    from scipy.optimize import minimize

    n = wanted.shape[1]
    slower = np.array([2.0, 3.0, 1.0])  # Kp, Ki, Kd go with these powers of the bandwidth
    merit = np.append(-np.ones(3 * n), PENALTY)
    limits = [(-8.0, 0.0)] * (3 * n) + [(0.0, 2.0)]
    heavy_poses: list[FloatArray] = []
    undamped_poses: list[int] = []

    def gains(y: FloatArray) -> FloatArray:
        return np.asarray(wanted * np.exp(y[:-1].reshape(3, n)))

    @lru_cache(maxsize=1)
    def constraints(key: bytes) -> tuple[FloatArray, FloatArray]:
        """Return what has to be >= 0, and its derivatives by (ln K, shortfall)."""
        y = np.frombuffer(key)
        table = gains(y)
        values, rows = [], []
        for pose in heavy_poses:
            load, parts, _ = bound.load_at(table[2], pose)
            values.append(np.log(part / load))
            rows.append([*np.zeros(2 * n), *-parts, 0.0])
        for k in undamped_poses:
            for ratio, slope in zip(*loops.slopes(table, k, count=PAIRS), strict=True):
                values.append(ratio - damping[k] + y[-1])
                rows.append([*slope.reshape(-1), 1.0])
        return np.array(values), np.array(rows)

    held: Any = {
        "type": "ineq",
        "fun": lambda y: constraints(y.tobytes())[0],
        "jac": lambda y: constraints(y.tobytes())[1],
    }

    def searched(y: FloatArray) -> FloatArray:
        for turn in range(ROUNDS):
            short = damping - loops.ratios(gains(y)) - y[-1]
            new = [k for k in np.flatnonzero(short > SLACK).tolist() if k not in undamped_poses]
            load, pose = bound.worst(gains(y)[2])
            heavy = load > (1.0 + SLACK) * part
            # A lowered start may be damped where the first was not, and lower than it need be.
            if not new and not heavy and (turn or not undamped_poses):
                break
            undamped_poses.extend(new)
            heavy_poses.extend([pose] * heavy)
            constraints.cache_clear()
            y = minimize(
                lambda y: merit @ y, y, jac=lambda _: merit, method="SLSQP", bounds=limits,
                constraints=held, options={"maxiter": 20, "ftol": 1e-3},
            ).x  # fmt: skip
            if y[-1] > damping.max():
                break  # unstable somewhere at best
        table = gains(y)
        table[2] *= min(1.0, part / max(bound.worst(table[2])[0], 1e-300))
        return table

    found, least = wanted, np.inf
    # Where a search ends far from what is wanted another begins at less bandwidth.
    for lowered in STARTING_PARTS:
        start = np.append(np.repeat(np.log(lowered) * slower, n), 0.0)
        table = searched(start)
        short = float((damping - loops.ratios(table)).max())
        if short < least:
            found, least = table, short
        if least < ENOUGH:
            break
    return found
