"""Planar n-R arms against the energies of points and rods in the plane, differentiated here."""

import numpy as np
import pytest
import sympy

from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError


def lagrange(n, lengths, masses, gravity, rods):
    """M, C q' and G of n point masses or rods as functions of (q, q'), by sympy."""
    q, v = sympy.symbols(f"q:{n}"), sympy.symbols(f"v:{n}")
    kinetic = potential = sympy.Integer(0)
    x = z = sympy.Integer(0)
    angle = rate = sympy.Integer(0)
    for k in range(n):
        angle, rate = angle + q[k], rate + v[k]
        along = sympy.Rational(1, 2) if rods else 1
        at = [x + along * lengths[k] * sympy.cos(angle), z + along * lengths[k] * sympy.sin(angle)]
        speed2 = sum(sum(sympy.diff(part, q[j]) * v[j] for j in range(n)) ** 2 for part in at)
        kinetic += masses[k] * speed2 / 2
        if rods:
            kinetic += masses[k] * lengths[k] ** 2 / 24 * rate**2
        potential += masses[k] * gravity * at[1]
        x, z = x + lengths[k] * sympy.cos(angle), z + lengths[k] * sympy.sin(angle)
    mass = sympy.hessian(kinetic, v)
    momentum = [sympy.diff(kinetic, v[i]) for i in range(n)]
    coriolis = [
        sum(sympy.diff(momentum[i], q[j]) * v[j] for j in range(n)) - sympy.diff(kinetic, q[i])
        for i in range(n)
    ]
    weight = [sympy.diff(potential, q[i]) for i in range(n)]
    return sympy.lambdify([q, v], [mass, coriolis, weight], modules="numpy", cse=True)


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
@pytest.mark.parametrize("n", [2, 3, 4, 5, 6])
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


@pytest.mark.parametrize("rods", [False, True])
def test_terms_follow_from_sympy_s_lagrangian(rods):
    lengths, masses = (0.7, 1.1, 0.4), (1.3, 0.6, 2.0)
    arm = Arm.planar(lengths, masses, gravity=9.8, rods=rods)
    truth = lagrange(3, lengths, masses, 9.8, rods)
    rng = np.random.default_rng(0)
    for _ in range(10):
        q, v = rng.uniform(-np.pi, np.pi, 3), rng.normal(size=3)
        mass, coriolis, weight = truth(q, v)
        np.testing.assert_allclose(arm.mass_matrix(q), mass, rtol=0, atol=1e-9)
        np.testing.assert_allclose(arm.coriolis_matrix(q, v) @ v, coriolis, rtol=0, atol=1e-9)
        np.testing.assert_allclose(arm.gravity_vector(q), weight, rtol=0, atol=1e-9)


@pytest.mark.parametrize("n", [1, 7, 50])
def test_any_number_of_links(n):
    arm = Arm.planar(np.full(n, 0.5), np.full(n, 0.3))
    assert arm.n == n
    reach = arm.tool_pose(np.zeros(n))[:3, 3]
    np.testing.assert_allclose(reach, [0.5 * n, 0, 0], atol=1e-12)
    assert np.linalg.eigvalsh(arm.mass_matrix(arm.home))[0] > 0


def test_one_link_is_a_pendulum():
    arm = Arm.planar(0.5, 2.0, gravity=9.8)
    q = [0.3]
    np.testing.assert_allclose(arm.mass_matrix(q), [[2.0 * 0.25]])
    np.testing.assert_allclose(arm.gravity_vector(q), [2.0 * 9.8 * 0.5 * np.cos(0.3)])


def test_gravity_may_be_off_or_tilted():
    assert not Arm.planar((1, 1), (1, 1), gravity=0).gravity_vector((0.3, 0.4)).any()
    tilted = Arm.planar((1, 1), (1, 1), gravity=(0.0, -9.8, 0.0))
    np.testing.assert_allclose(tilted.gravity_vector((0.3, 0.4)), 0, atol=1e-12)
    assert tilted.gravity == 9.8


@pytest.mark.parametrize(
    ("lengths", "masses", "message"),
    [
        ((1.0, 0.8), (1.0,), r"masses: expected shape \(2,\)"),
        ((1.0, 0.0), (1.0, 1.0), r"lengths\.1: expected a number > 0, got 0"),
        ((1.0, 1.0), (1.0, -1.0), r"masses\.1: expected a number > 0, got -1"),
        ((1.0, np.nan), (1.0, 1.0), r"lengths\.1"),
        ("long", (1.0,), "lengths: expected numbers"),
        ((), (), "lengths: expected numbers"),
    ],
)
def test_bad_lengths_and_masses_are_named(lengths, masses, message):
    with pytest.raises(ArgumentError, match=message):
        Arm.planar(lengths, masses)


def test_drawings_have_a_link_a_joint_and_a_mass_each():
    model, geometry = Arm.planar((1.0, 0.8, 0.5), (1, 1, 1)).visual()
    names = [thing.name for thing in geometry.geometryObjects]
    assert names == [f"{part}{k}" for k in (1, 2, 3) for part in ("joint", "link", "mass")]
    assert model.nq == 3
    _, rods = Arm.planar((1.0, 0.8), (1, 1), rods=True).visual()
    assert not any(thing.name.startswith("mass") for thing in rods.geometryObjects)
