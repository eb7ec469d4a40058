"""Planar n-R arms against the energies of points and rods, and the paper's against eq. (35)."""

import numpy as np
import pytest

from fpid_pin.arms import Arm


def energies(q, lengths, masses, gravity, rods):
    """Mass matrix and potential energy from the points' velocities; q may be complex."""
    n = len(lengths)
    angle = np.cumsum(q)
    mass = np.zeros((n, n), dtype=q.dtype)
    potential = 0.0
    base = np.zeros(2, dtype=q.dtype)
    slope = np.zeros((2, n), dtype=q.dtype)  # of the link's start, by q
    for k in range(n):
        way = np.array([np.cos(angle[k]), np.sin(angle[k])])
        turn = np.outer([-way[1], way[0]], np.arange(n) <= k)
        along = lengths[k] * (0.5 if rods else 1.0)
        jacobian = slope + along * turn
        mass = mass + masses[k] * jacobian.T @ jacobian
        if rods:
            spin = np.outer(np.arange(n) <= k, np.arange(n) <= k)
            mass = mass + masses[k] * lengths[k] ** 2 / 12 * spin
        potential = potential + masses[k] * gravity * (base + along * way)[1]
        base, slope = base + lengths[k] * way, slope + lengths[k] * turn
    return mass, potential


def complex_step(q, v, *robot):
    """M, C q' and G by differentiating the energies with a complex step (no cancellation)."""
    h = 1e-30
    mass, _ = energies(q, *robot)
    coriolis = energies(q + 1j * h * v, *robot)[0].imag / h @ v
    weight = np.empty(len(q))
    for j, e in enumerate(np.eye(len(q))):
        ahead, potential = energies(q + 1j * h * e, *robot)
        weight[j] = potential.imag / h
        coriolis[j] -= 0.5 * v @ (ahead.imag / h) @ v
    return mass, coriolis, weight


@pytest.mark.parametrize("rods", [False, True])
@pytest.mark.parametrize("n", [1, 2, 5])
def test_terms_follow_from_the_energies(n, rods):
    rng = np.random.default_rng(n)
    robot = rng.uniform(0.3, 1.2, n), rng.uniform(0.2, 3.0, n)
    arm = Arm.planar(*robot, gravity=9.8, rods=rods)
    for _ in range(30):
        q, v = rng.uniform(-np.pi, np.pi, n), rng.normal(size=n)
        mass, coriolis, weight = complex_step(q, v, *robot, 9.8, rods)
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=1e-9)
        np.testing.assert_allclose(arm.coriolis_matrix(q, v) @ v, coriolis, rtol=0, atol=1e-9)
        np.testing.assert_allclose(arm.gravity_vector(q), weight, rtol=0, atol=1e-9)


def test_gravity_may_be_off_or_tilted():
    assert not Arm.planar((1, 1), (1, 1), gravity=0).gravity_vector((0.3, 0.4)).any()
    tilted = Arm.planar((1, 1), (1, 1), gravity=(0.0, -9.8, 0.0))
    np.testing.assert_allclose(tilted.gravity_vector((0.3, 0.4)), 0, atol=1e-12)
    assert tilted.gravity == 9.8


M1 = M2 = 1.0
L1, L2, G = 1.0, 0.8, 9.8


def paper(q, v):
    """M, C q', G of eq. (35) with m3 = 0."""
    s2, c2 = np.sin(q[1]), np.cos(q[1])
    m12 = M2 * L2**2 + M2 * L1 * L2 * c2
    mass = np.array([[(M1 + M2) * L1**2 + M2 * L2**2 + 2 * M2 * L1 * L2 * c2, m12], [m12, 0.0]])
    mass[1, 1] = M2 * L2**2
    k = M2 * L1 * L2 * s2
    coriolis = np.array([[-2 * k * v[1], -k * v[1]], [k * v[0], 0.0]])
    g2 = G * M2 * L2 * np.cos(q[0] + q[1])
    g1 = G * (M1 + M2) * L1 * np.cos(q[0]) + g2
    return mass, coriolis @ v, np.array([g1, g2])


@pytest.mark.parametrize("arm", [Arm.two_link(), Arm.planar((L1, L2), (M1, M2))])
def test_the_papers_robot_and_one_of_its_lengths_and_masses_have_the_terms_of_equation_35(arm):
    rng = np.random.default_rng(0)
    for _ in range(200):
        q, v = rng.uniform(-np.pi, np.pi, 2), rng.normal(0, 2, 2)
        mass, coriolis, gravity = paper(q, v)
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=1e-12)
        np.testing.assert_allclose(arm.coriolis_matrix(q, v) @ v, coriolis, rtol=0, atol=1e-12)
        np.testing.assert_allclose(arm.gravity_vector(q), gravity, rtol=0, atol=1e-12)
        # Angles turn counter clockwise in the vertical plane.
        x = L1 * np.cos(q[0]) + L2 * np.cos(q.sum())
        z = L1 * np.sin(q[0]) + L2 * np.sin(q.sum())
        np.testing.assert_allclose(arm.tool_pose(q)[:3, 3], [x, 0, z], atol=1e-14)


def test_no_limits_and_no_friction_are_given():
    arm = Arm.two_link()
    assert (arm.joint_names, arm.gravity) == (("joint1", "joint2"), 9.8)
    assert np.isinf([arm.effort_limit, arm.velocity_limit, arm.lower, arm.upper]).all()
    assert not np.any([arm.viscous_friction, arm.dry_friction, arm.home])
