"""The paper's robot against eq. (35), written out here."""

import numpy as np

from fpid_pin.arms import Arm

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


def states(count, seed=0):
    rng = np.random.default_rng(seed)
    return zip(rng.uniform(-np.pi, np.pi, (count, 2)), rng.normal(0, 2, (count, 2)), strict=True)


def test_terms_are_those_of_equation_35():
    arm = Arm.two_link()
    for q, v in states(200):
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


def test_the_planar_constructor_gives_the_same_robot():
    two, planar = Arm.two_link(), Arm.planar((L1, L2), (M1, M2))
    for q, v in states(50, seed=1):
        np.testing.assert_allclose(planar.mass_matrix(q), two.mass_matrix(q), atol=1e-14)
        tau = np.array([1.0, -2.0])
        a, b = planar.forward_dynamics(q, v, tau), two.forward_dynamics(q, v, tau)
        np.testing.assert_allclose(a, b, rtol=1e-12, atol=1e-12)
        np.testing.assert_allclose(planar.tool_pose(q), two.tool_pose(q), atol=1e-14)
