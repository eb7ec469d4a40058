"""Planar n-R arms against the energies of points and rods in the plane, differentiated here."""

import numpy as np
import pytest

from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError


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
@pytest.mark.parametrize("n", [2, 5])
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


@pytest.mark.parametrize("n", [1, 50])
def test_any_number_of_links(n):
    arm = Arm.planar(np.full(n, 0.5), np.full(n, 0.3))
    assert arm.n == n
    reach = arm.tool_pose(np.zeros(n))[:3, 3]
    np.testing.assert_allclose(reach, [0.5 * n, 0, 0], atol=1e-12)
    assert np.linalg.eigvalsh(arm.mass_matrix(arm.home))[0] > 0


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
        ("long", (1.0,), "lengths: expected numbers"),
    ],
)
def test_bad_lengths_and_masses_are_named(lengths, masses, message):
    with pytest.raises(ArgumentError, match=message):
        Arm.planar(lengths, masses)
