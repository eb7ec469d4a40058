"""The theorem of docs/supervisor.md: against random systems and their worst cases, and on arms.

Systems are e'' = a0 - change + w, one a robot, with the identity as mass matrix, so that what is
reserved for a torque is reserved for an acceleration. Relative tolerances of 1e-9 are rounding's,
with room: V and what is compared with it are sums of a hundred terms of their own size at most.
"""

import functools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.disturbances import Cosine
from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.records import GIVEN, ROBOT
from fpid_pin.kernels.supervisor import find_correction, least_correction

RUNS = 400


def systems(seed, n):
    """Return V_T, h, T, r_min and P, (runs,), of random supervisors, and their records."""
    rng = np.random.default_rng(seed)
    robots, joints = np.zeros(RUNS, ROBOT), np.zeros((RUNS, n), GIVEN)
    tolerance = np.zeros(RUNS)
    for r in range(RUNS):
        while tolerance[r] == 0.0:  # a look-ahead so long that nothing is tolerated
            k0 = 10.0 ** rng.uniform(-1.0, 2.0)
            k1, h = 2.0 * rng.uniform(0.2, 1.5) * np.sqrt(k0), 10.0 ** rng.uniform(-4.0, -2.3)
            guard = fp.Supervisor(
                10.0 ** rng.uniform(-1.0, 1.0) + 1.0, 1.0, k0=k0, k1=k1,
                target=rng.uniform(0.5, 1.0), lookahead=h * rng.choice([1.0, 3.0, 10.0]),
            )  # fmt: skip
            tolerance[r] = guard.tolerance(h)
        robots["h"][r] = h
        for name, value in guard.constants(h).items():
            robots[name][r] = value
    return rng, robots, joints, tolerance


def eta_of(robots):
    """Return eta, the curvature of V in the acceleration, (runs,)."""
    h, pi = robots["h"], robots["p22"] + robots["h"] * robots["p12"]
    return robots["lookahead"] ** 2 * (pi + h**2 * robots["p11"] / 4.0)


def energy(robots, e, rate):
    p11, p12, p22 = (robots[name][:, np.newaxis] for name in ("p11", "p12", "p22"))
    return 0.5 * (p11 * e**2 + 2.0 * p12 * e * rate + p22 * rate**2).sum(axis=1)


def place(rng, robots, n, level):
    """Return errors and rates with V = level V_T; every third at the tip, where the ball is least.

    There E is P^-1 (1, T - h/2), the same in all joints but for a factor.
    """
    e, rate = rng.normal(size=(2, RUNS, n))
    tip = (robots["lookahead"] - robots["h"] / 2.0)[::3, np.newaxis]
    p11, p12, p22 = (robots[name][::3, np.newaxis] for name in ("p11", "p12", "p22"))
    rate[::3] = (p11 * tip - p12) * e[::3]
    e[::3] *= p22 - p12 * tip
    factor = np.sqrt(level * robots["target"] / energy(robots, e, rate))[:, np.newaxis]
    return factor * e, factor * rate


@kernel
def correct(robots, joints, acceleration, direction, change):
    for r in range(robots.size):
        find_correction(robots[r], joints[r], acceleration[r], direction[r])
        for j in range(direction.shape[1]):
            change[r, j] = direction[r, j]
        least_correction(robots[r], joints[r], direction[r], change[r])


def act(robots, joints, e, rate, a0):
    """Return the change that the kernels make, and the unit vectors along which they make it."""
    joints["e"], joints["v_ref"], joints["a_ref"] = e, rate, a0
    direction, change = np.zeros((2, *e.shape))
    correct(robots, joints, np.zeros(e.shape), direction, change)
    return change, direction


def after(robots, e, rate, a, part=1.0):
    """Return V after `part` of a step in which e'' is a."""
    t = part * robots["h"][:, np.newaxis]
    return energy(robots, e + t * rate + t**2 / 2.0 * a, rate + t * a)


def adversaries(rng, direction, size):
    """Yield accelerations of a size: along z, against it, across it, at random."""
    yield size * direction
    yield -size * direction
    for across in (True, False, False):
        w = rng.normal(size=direction.shape)
        if across:
            w -= (w * direction).sum(axis=1, keepdims=True) * direction
        norm = np.linalg.norm(w, axis=1, keepdims=True)
        # A single joint has nothing across.
        yield size * w / np.where(norm > 1e-9, norm, np.inf)


@pytest.mark.parametrize("n", [1, 2, 4, 7])
def test_what_is_reserved_for_and_below_r_min_never_drives_v_out(n):
    rng, robots, joints, tolerance = systems(n, n)
    acted = 0
    for level in (1.0, 0.9, 0.3):
        e, rate = place(rng, robots, n, level)
        delta = (rng.choice([0.3, 0.999], RUNS) * tolerance)[:, np.newaxis]
        joints["bound"] = delta  # the sum over joints is then at least delta, whatever z
        a0 = rng.normal(size=e.shape) * 10.0 ** rng.uniform(-1.0, 3.5, (RUNS, 1))
        change, direction = act(robots, joints, e, rate, a0)
        acted += (change != 0.0).any(axis=1).sum()
        v, v_t, part = energy(robots, e, rate), robots["target"], robots["h"] / robots["lookahead"]
        for w in adversaries(rng, direction, delta):
            v_next = after(robots, e, rate, a0 - change + w)
            assert (v_next <= ((1.0 - part) * v + part * v_t) * (1.0 + 1e-9)).all()
    assert acted > 0.3 * 3 * RUNS


@pytest.mark.parametrize("n", [1, 2, 7])
def test_bounded_torques_drive_it_out_by_no_more_than_the_excess_that_the_docs_give(n):
    rng, robots, joints, tolerance = systems(10 + n, n)
    v_t, eta, part = robots["target"], eta_of(robots), robots["h"] / robots["lookahead"]
    kappa = 1.0 - eta * tolerance**2 / (2.0 * v_t)
    for size in (0.1, 1.0, 3.0):
        bound = rng.uniform(0.0, 1.0, (RUNS, n)) ** 4 * size * tolerance[:, np.newaxis]
        joints["bound"] = bound
        level = rng.uniform(0.5, 1.5, RUNS)
        e, rate = place(rng, robots, n, level)
        a0 = rng.normal(size=e.shape) * 10.0 ** rng.uniform(-1.0, 3.5, (RUNS, 1))
        change, direction = act(robots, joints, e, rate, a0)
        reserve = np.minimum((np.abs(direction) * bound).sum(axis=1), robots["radius"])
        v = energy(robots, e, rate)
        within = np.maximum(v_t, kappa * v)
        worst = np.maximum(np.linalg.norm(bound, axis=1) ** 2 - reserve**2, 0.0)
        limit = (1.0 - part) * v + part * (within + eta / 2.0 * worst)
        # Outside of the set kappa V stands for V*, which is as large only at the tip.
        for corner in (np.sign(direction), *rng.choice([-1.0, 1.0], (4, RUNS, n))):
            v_next = after(robots, e, rate, a0 - change + corner * bound)
            assert (v_next <= limit * (1.0 + 1e-9)).all()


def test_r_min_is_the_smallest_radius_of_the_ball_within_the_set():
    rng, robots, joints, tolerance = systems(20, 3)
    radii = []
    for level in (1.0, 0.99, 0.5):
        e, rate = place(rng, robots, 3, level)
        act(robots, joints, e, rate, np.zeros(e.shape))
        radii.append(robots["radius"].copy())
    # V_T - V* is (1 - kappa) V_T there, down to 1e-4 of its terms.
    assert radii[0][::3] == pytest.approx(tolerance[::3], rel=1e-9)
    assert (np.array(radii) >= tolerance * (1.0 - 1e-9)).all()


@functools.cache
def arm_of(name):
    arm = fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)
    return arm.with_limits(effort=np.inf)


@pytest.mark.parametrize("name", ["two_link", "ur5", "panda"])
@pytest.mark.parametrize("step", [1e-3, 4e-3])
def test_on_an_arm_every_step_keeps_to_it_where_r_min_covers_the_push(name, step):
    arm = arm_of(name)
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    reference = fp.references.Sinusoid(0.3, phase=phase, offset=arm.home)
    guard = fp.Supervisor(2.3, 0.3)
    r_min = guard.tolerance(step)
    # d_u reaches r_min, nearly, where it tells most among 500 poses: no warning, which is an error.
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    poses = [arm.home, *np.random.default_rng(1).uniform(low, high, (500, arm.n))]
    inverses = np.abs(np.linalg.inv([arm.mass_matrix(q) for q in poses]))
    bound = 1.0 / np.linalg.norm(inverses, axis=1).max(axis=0)
    bound *= 0.95 * r_min / np.linalg.norm(inverses @ bound, axis=1).max()
    # From near the tip of the set, where the law alone leaves it at once.
    tip = np.linalg.solve(guard.p, [1.0, step / 2.0])
    tip *= np.sqrt(0.9 * guard.threshold / (0.5 * arm.n * tip @ guard.p @ tip))
    (q,), (v,), _ = reference.sample(np.zeros(1))
    experiment = fp.Experiment(
        arm, reference, q - tip[0], v - tip[1], step=step, duration=1.0, integrator="rk4",
        plant=fp.Plant(disturbance=Cosine(-2.0 / 3.0 * bound, 1.0)),
    )  # fmt: skip
    laws = [
        fp.AdaptiveFpid(kp=100.0, ki=200.0, kd=20.0, learning_rate=0.0, scale="inertia",
                        supervisor=one)
        for one in (None, fp.Supervisor(2.3, 0.3, disturbance_bound=bound))
    ]  # fmt: skip
    alone, run = fp.simulate(experiment, laws)
    rate = alone.v_ref - alone.v
    p = guard.p
    v = 0.5 * (p[0, 0] * alone.error**2 + 2.0 * p[0, 1] * alone.error * rate + p[1, 1] * rate**2)
    assert v.sum(axis=1).max() > 2.0 * guard.threshold
    assert (run.u_s != 0.0).any()
    # (1 - h/T) V_k + (h/T) V_T is V_T here; with what the docs say of bounded torques,
    # V_T + eta/2 r_min^2. The third of d_u that the push leaves is for the model's own change
    # within a step. By that e, too, is off what e'' of the same mean makes of it: measured.
    e, rate = run.error, run.v_ref - run.v
    mean = np.diff(rate, axis=0) / step
    off = np.linalg.norm(e[1:] - e[:-1] - step * rate[:-1] - step**2 / 2.0 * mean, axis=1)
    pi = p[1, 1] + step * p[0, 1] + step**2 * p[0, 0] / 4.0
    kept = guard.threshold + step**2 * pi / 2.0 * r_min**2
    assert (np.sqrt(2.0 * run.lyapunov[1:]) <= np.sqrt(2.0 * kept) + np.sqrt(p[0, 0]) * off).all()
