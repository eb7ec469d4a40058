"""Dry friction: rests below breakaway, slides as the closed form says, never pushes."""

import numpy as np
import pytest
import scipy.optimize

from fpid_pin.arms import Arm, DryFriction, Fleet
from fpid_pin.exceptions import ArgumentError


def simulate(arms, torque, duration, step=1e-3, q0=None, v0=None):
    """Semi-implicit Euler as the engine does it; torque(t, q, v, gravity); rows of q, v, l."""
    runs, n = len(arms), arms[0].n
    viscous = np.array([arm.viscous_friction for arm in arms])
    fleet = Fleet(arms, runs, armature=step * viscous)
    friction = DryFriction(fleet, np.array([arm.dry_friction for arm in arms]), step)
    q = np.array([arm.home for arm in arms]) if q0 is None else np.array(q0, dtype=float)
    v = np.zeros((runs, n)) if v0 is None else np.array(v0, dtype=float)
    a, weight = np.empty((runs, n)), np.empty((runs, n))
    rows = []
    for k in range(round(duration / step)):
        fleet.gravity(q, weight)
        tau = torque(k * step, q, v, weight) - viscous * v
        fleet.forward_dynamics(q, v, tau, a)
        v += step * a
        assert friction.apply(q, v) is v
        q += step * v
        rows.append((q.copy(), v.copy(), friction.force.copy()))
    return [np.array(part) for part in zip(*rows, strict=True)]


def bar(inertia, viscous=0.0, dry=1.0):
    """One joint with this inertia, horizontal."""
    return Arm.planar(1.0, inertia, gravity=0.0).with_friction(viscous, dry)


RUBBING = ("xarm7", "z1", "talos_arm")


@pytest.mark.parametrize("step", [1e-3, 2e-3])
@pytest.mark.parametrize("name", RUBBING)
@pytest.mark.parametrize("part", [0.0, 0.5, 0.9])
def test_joints_rest_below_breakaway(name, part, step):
    arm = Arm.from_example(name)
    side = np.array([1, -1, 1, 1, -1, 1, -1])
    _, v, _ = simulate([arm], lambda t, q, v, g: g + part * side * arm.dry_friction, 0.05, step)
    assert np.abs(v[-1]).max() < 1e-9


@pytest.mark.parametrize("name", RUBBING)
def test_joints_come_to_rest_from_motion(name):
    arm = Arm.from_example(name)
    push = 0.9 * arm.dry_friction
    start = [np.full(arm.n, 0.05)]
    _, v, _ = simulate([arm], lambda t, q, v, g: g + push * -1.0, 0.5, v0=start)
    assert np.abs(v[-1]).max() < 1e-9


@pytest.mark.parametrize("inertia", [1e-4, 1e-2, 1.0])
def test_sliding_joint_follows_the_closed_form(inertia):
    """M v' = tau - F_d at twice the breakaway torque: v = F_d t / M."""
    arm = bar(inertia)
    _, v, force = simulate([arm], lambda t, q, v, g: g + 2.0, 0.05)
    assert v[-1, 0, 0] == pytest.approx(0.05 / inertia, rel=1e-2)
    assert v[-1, 0, 0] == pytest.approx(0.05 / inertia, rel=1e-12)
    assert np.array_equal(force, np.ones_like(force))


@pytest.mark.parametrize("inertia", [1.0, 10.0])
def test_sliding_joint_with_viscous_friction_follows_the_closed_form(inertia):
    """M v' = tau - F_d - F_v v: v = (tau - F_d) / F_v (1 - exp(-F_v t / M))."""
    arm = bar(inertia, viscous=2.0)
    _, v, _ = simulate([arm], lambda t, q, v, g: g + 2.0, 0.05)
    exact = 0.5 * -np.expm1(-2.0 * 0.05 / inertia)
    assert v[-1, 0, 0] == pytest.approx(exact, rel=1e-2)


def test_light_joints_neither_chatter_nor_creep():
    """M = 1e-4, F_d = 1: a torque that swings inside the breakaway never moves the joint."""
    arm = bar(1e-4)
    inside = simulate([arm], lambda t, q, v, g: g + 0.99 * np.sin(300 * t), 0.2)
    assert np.array_equal(inside[1], np.zeros_like(inside[1]))
    # And one that swings past it: the speed turns twice a period, not every step.
    _, v, _ = simulate([arm], lambda t, q, v, g: g + 1.5 * np.sin(20 * np.pi * t), 1.0)
    side = np.sign(v[:, 0, 0])
    turns = np.count_nonzero(np.diff(side[side != 0.0]))
    assert turns == 19
    # It starts where 1.5 sin a = 1, stops at b where the impulse is spent, starts again at a + pi.
    a = np.arcsin(1 / 1.5)
    b = scipy.optimize.brentq(lambda x: 1.5 * (np.cos(a) - np.cos(x)) - (x - a), 2.0, 4.0)
    assert np.mean(side[200:] == 0.0) == pytest.approx((a + np.pi - b) / np.pi, abs=0.02)


def test_a_stopping_joint_stops_where_it_should():
    """Sliding from v0 under F_d alone: the way to rest is M v0^2 / (2 F_d)."""
    arm = bar(0.5)
    q, v, _ = simulate([arm], lambda t, q, v, g: g, 0.6, v0=[[1.0]])
    assert v[-1, 0, 0] == 0.0
    assert q[-1, 0, 0] == pytest.approx(0.25, rel=3e-3)


@pytest.mark.parametrize("name", RUBBING)
def test_friction_never_adds_energy(name):
    arm = Arm.from_example(name)
    rng = np.random.default_rng(0)
    runs = 8
    start = rng.normal(0, 2, (runs, arm.n))
    weightless = arm.with_gravity(0.0)
    _, v, force = simulate([weightless] * runs, lambda t, q, v, g: 0.0 * q, 0.2, v0=start)
    assert (force * v >= 0.0).all()
    assert (np.abs(force) <= arm.dry_friction).all()


def test_energy_falls_at_every_step_of_one_solve():
    """At a fixed pose v+ has no more energy than v_free, in the metric of M."""
    arm = Arm.from_example("xarm7")
    rng = np.random.default_rng(1)
    q, free = rng.normal(size=(200, 7)), rng.normal(0, 0.2, (200, 7))
    friction = DryFriction(Fleet([arm], 200), arm.dry_friction, 1e-3)
    after = friction.apply(q, free.copy())
    for k in range(200):
        before = arm.kinetic_energy(q[k], free[k])
        assert arm.kinetic_energy(q[k], after[k]) <= before * (1 + 1e-12)


@pytest.mark.parametrize("speed", [1e-4, 1e-2, 0.1, 1.0])
@pytest.mark.parametrize("name", RUBBING)
def test_solution_is_that_of_a_bounded_least_squares_solver(name, speed):
    """Minimise 1/2 l^T h M^-1 l - l^T v_free over the box, by scipy's BVLS."""
    arm = Arm.from_example(name)
    rng = np.random.default_rng(2)
    runs, h = 40, 1e-3
    q, free = rng.uniform(-2, 2, (runs, arm.n)), rng.normal(0, speed, (runs, arm.n))
    fleet = Fleet([arm], runs, armature=h * arm.viscous_friction)
    friction = DryFriction(fleet, arm.dry_friction, h)
    inverse = np.empty((runs, arm.n, arm.n))
    fleet.inverse_mass_matrix(q, inverse)
    # Twice: from a cold start and from the sticking joints that the first left.
    for _ in range(2):
        after = friction.apply(q, free.copy())
        for k in range(runs):
            root = np.linalg.cholesky(h * inverse[k]).T
            bound = arm.dry_friction
            goal = np.linalg.solve(root.T, free[k])
            best = scipy.optimize.lsq_linear(root, goal, (-bound, bound), "bvls", tol=1e-14).x
            np.testing.assert_allclose(friction.force[k], best, atol=1e-6)
            expected = free[k] - h * inverse[k] @ friction.force[k]
            np.testing.assert_allclose(after[k], expected, rtol=1e-9, atol=1e-12)
            slides = after[k] != 0.0
            np.testing.assert_allclose(
                friction.force[k][slides], (bound * np.sign(after[k]))[slides], rtol=1e-12
            )


def test_joints_without_dry_friction_are_free():
    arm = Arm.planar((1.0, 0.8), (1, 1)).with_friction(dry=(0.0, 5.0))
    rng = np.random.default_rng(3)
    q, free = rng.normal(size=(50, 2)), rng.normal(0, 0.01, (50, 2))
    friction = DryFriction(Fleet([arm], 50), arm.dry_friction, 1e-3)
    after = friction.apply(q, free.copy())
    assert not friction.force[:, 0].any()
    assert (after[:, 0] != 0.0).all()
    none = DryFriction(Fleet([arm], 50), 0.0 * arm.dry_friction, 1e-3)
    assert np.array_equal(none.apply(q, free.copy()), free)


def swing(t, q, v, g):
    """Hold against gravity, and push to and fro past the breakaway at all phases."""
    return g + 1.5 * np.sin(20 * t + np.arange(q.shape[1]))


@pytest.mark.parametrize("name", RUBBING)
def test_stiff_friction_is_stable_at_one_and_two_milliseconds(name):
    arm = Arm.from_example(name)
    model, phase = Fleet([arm], 1), np.arange(arm.n)

    def track(t, q, v, g):
        """Computed torque along a swing of 0.3 rad, with the friction of the swing fed forward."""
        at, speed = 0.3 * np.sin(2 * t + phase), 0.6 * np.cos(2 * t + phase)
        tau = np.empty_like(q)
        pull = 100.0 * (arm.home + at - q) + 20.0 * (speed - v) - 4.0 * at
        model.mass_times(q, pull, tau)
        return tau + g + arm.viscous_friction * speed + arm.dry_friction * np.sign(speed)

    paths = []
    for step in (1e-3, 2e-3):
        q, v, _ = simulate([arm], track, 5.0, step)
        assert np.abs(v).max() < 3.0
        # Every joint slides both ways and stops between; none flips from step to step.
        side = np.sign(v[:, 0, :])
        assert ((side > 0).any(axis=0) & (side < 0).any(axis=0) & (side == 0).any(axis=0)).all()
        assert np.count_nonzero(side[1:] * side[:-1] < 0, axis=0).max() <= 10
        paths.append(q[:, 0])
    # Twice the step, the same motion.
    assert np.abs(paths[0][1::2] - paths[1]).max() < 5e-3


def test_same_bits_in_chunks_of_any_size():
    rng = np.random.default_rng(4)
    runs = 64
    base = Arm.from_example("xarm7")
    arms = [base.perturbed(rng, friction=0.5) for _ in range(runs)]
    arms[20:40] = [base] * 20
    q0, v0 = rng.normal(0, 0.5, (runs, 7)), rng.normal(0, 0.5, (runs, 7))
    whole = simulate(arms, swing, 0.06, q0=q0, v0=v0)
    assert (whole[1] == 0.0).any()
    assert (whole[1] != 0.0).any()
    for size in (1, 3, 17, 60):
        for start in list(range(0, runs, size))[:: 7 if size == 1 else 1]:
            rows = slice(start, start + size)
            part = simulate(arms[rows], swing, 0.06, q0=q0[rows], v0=v0[rows])
            for one, all_ in zip(part, whole, strict=True):
                assert np.array_equal(one, all_[:, rows])


def test_a_diverged_run_leaves_the_others_alone_and_a_retired_one_is_zero():
    arm = Arm.from_example("xarm7")
    rng = np.random.default_rng(5)
    q, free = rng.normal(size=(4, 7)), rng.normal(0, 0.1, (4, 7))
    alone = DryFriction(Fleet([arm], 4), arm.dry_friction, 1e-3)
    expected = alone.apply(q, free.copy())
    ill = DryFriction(Fleet([arm], 4), arm.dry_friction, 1e-3)
    spoilt = free.copy()
    spoilt[2, 3] = np.nan
    after = ill.apply(q, spoilt)
    assert np.isnan(after[2]).any()
    keep = [0, 1, 3]
    assert np.array_equal(after[keep], expected[keep])
    ill.retire(2)
    q[2], free[2] = 0.0, 0.0
    after = ill.apply(q, free.copy())
    assert not after[2].any()
    assert not ill.force[2].any()
    assert ill.force[keep].all()


@pytest.mark.parametrize(
    ("dry", "step", "message"),
    [
        ((1.0, 2.0, 3.0), 1e-3, r"dry friction: expected shape \(2,\) or \(5, 2\), got shape"),
        ((-1.0, 0.0), 1e-3, r"dry friction\.0: expected a number >= 0"),
        ((1.0, 1.0), 0.0, "step: expected a number > 0"),
    ],
)
def test_bad_arguments_are_named(dry, step, message):
    with pytest.raises(ArgumentError, match=message):
        DryFriction(Fleet([Arm.two_link()], 5), dry, step)
