"""Dynamics of random chains of turning and sliding joints against Pinocchio; dry friction."""

import numba
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpid_pin.arms.rigid_body import bodies_of, inertial_numbers
from fpid_pin.kernels import plant, rigid_body, tick
from fpid_pin.kernels.records import FRAME, LINK, PLANT, WORKSPACE

pytestmark = pytest.mark.kernels
#: Without compilation (test_line_by_line) a few go through every branch.
EXAMPLES = 6 if numba.config.DISABLE_JIT else 80
chains = given(st.integers(1, 9), st.integers(0, 10**6))


def random_chain(seed, n):
    """Return a model with n joints one behind the other."""
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    model = pin.Model()
    kinds = [
        pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ,
        pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ,
    ]  # fmt: skip
    for k in range(n):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        free = [pin.JointModelRevoluteUnaligned(axis), pin.JointModelPrismaticUnaligned(axis)]
        joint = kinds[rng.integers(6)]() if rng.random() < 0.6 else free[rng.integers(2)]
        added = model.addJoint(k, joint, pin.SE3.Random(), f"joint{k}")
        model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
    model.gravity.linear = rng.normal(size=3) * 10.0
    model.armature = rng.uniform(0.0, 0.5, model.nv)
    return model, rng


def mass_matrix(model, q):
    upper = np.triu(pin.crba(model, model.createData(), q))
    return upper + np.triu(upper, 1).T


def factored(model, q, v, tau):
    """Return M, C q' + G, q'' and the factors of M by the kernels."""
    n, gravity = model.nv, np.array(model.gravity.linear)
    frames = np.zeros(n + 1, FRAME)
    bias, mass, a = np.zeros(n), np.zeros((n, n)), np.zeros(n)
    rigid_body.mass_matrix_and_bias(bodies_of(model), frames, gravity, q, v, bias, mass)
    whole = np.tril(mass) + np.tril(mass, -1).T
    rigid_body.forward_dynamics(bodies_of(model), frames, gravity, q, v, tau, mass, a)
    return whole, bias, a, mass


@settings(max_examples=EXAMPLES)
@chains
def test_random_chains_move_as_pinocchio_has_them(n, seed):
    model, rng = random_chain(seed, n)
    data = model.createData()
    q, v, tau = rng.normal(size=(3, n)) * 2.0
    mass, bias, a, factors = factored(model, q, v, tau)
    m = mass_matrix(model, q)
    size = np.abs(m).max()
    assert np.abs(mass - m).max() < 1e-12 * size
    h = pin.rnea(model, data, q, v, np.zeros(n))
    assert np.abs(bias - h).max() < 1e-12 * max(np.abs(h).max(), size)
    # What solving makes of rounding grows with the condition of M.
    loss = 1e-14 * np.linalg.cond(m) + 1e-12
    exact = pin.aba(model, data, q, v, tau)
    assert np.abs(a - exact).max() < 10.0 * loss * np.abs(exact).max()
    x, product = tau.copy(), np.zeros(n)
    rigid_body.solve_symmetric(factors, x)
    assert np.abs(m @ x - tau).max() < 10.0 * loss * np.abs(tau).max()
    tick.mass_times(np.tril(m), tau, product)
    assert np.abs(product - m @ tau).max() < 1e-13 * size * n * np.abs(tau).max()


def asked(model, q, v, w, a, inertias=None):
    """Return M a + C(q, v) w + G by the kernel, and the arrays that it leaves."""
    n = model.nv
    own, links, motions, out = bodies_of(model), np.zeros(n, LINK), np.zeros((3, n, 6)), np.zeros(n)
    inertias = inertial_numbers(own) if inertias is None else inertias
    gravity = np.array(model.gravity.linear)
    tick.inverse_dynamics(own, inertias, links, motions, gravity, q, v, w, a, out)
    return out, links, motions


@settings(max_examples=EXAMPLES)
@chains
def test_two_velocities_are_the_symmetric_form_of_pinocchios_coriolis_torque(n, seed):
    """C(q, v) w by polarisation, c((v + w)/2) - c((v - w)/2) with c(x) = C(q, x) x."""
    model, rng = random_chain(seed, n)
    data = model.createData()
    q, v, w, a = rng.normal(size=(4, n))
    zero = np.zeros(n)
    gravity = pin.rnea(model, data, q, zero, zero)
    exact = pin.rnea(model, data, q, (v + w) / 2, a) + gravity
    exact -= pin.rnea(model, data, q, (v - w) / 2, zero)
    size = max(np.abs(exact).max(), np.abs(gravity).max(), 1.0)
    found = asked(model, q, v, w, a)[0]
    assert np.abs(found - exact).max() < 1e-12 * size
    assert np.abs(asked(model, q, w, v, a)[0] - found).max() < 1e-12 * size
    plain = pin.rnea(model, data, q, v, a)
    assert np.abs(asked(model, q, v, v, a)[0] - plain).max() < 1e-12 * max(np.abs(plain).max(), 1.0)


@settings(max_examples=EXAMPLES)
@chains
def test_derivatives_by_the_inertial_numbers_are_differences_of_torques(n, seed):
    """Torques are linear in the numbers: a difference has no error but rounding."""
    model, rng = random_chain(seed, n)
    q, v, w, a, s = rng.normal(size=(5, n))
    _, links, motions = asked(model, q, v, w, a)
    found = np.full((n, 10), np.nan)
    tick.velocities(bodies_of(model), links, s, motions[2])
    tick.gradient(links, motions, found)
    change, own = rng.normal(size=(n, 10)), inertial_numbers(bodies_of(model))
    more, less = (asked(model, q, v, w, a, own + x)[0] for x in (change, -change))
    slope = s @ (more - less) / 2.0
    assert slope == pytest.approx((found * change).sum(), rel=1e-10, abs=1e-10)


def plant_joints(dry, guess):
    joints = np.zeros(len(dry), PLANT)
    joints["dry"], joints["stuck"] = dry, guess
    return joints


def rubbed(model, q, v_free, dry, guess, h):
    """Return the speeds that the kernel leaves, and the joints."""
    n = model.nv
    factors = factored(model, q, v_free, np.zeros(n))[3]
    joints, v = plant_joints(dry, guess), v_free.copy()
    workspace = np.zeros((WORKSPACE + 2 * n, n))
    plant.apply_dry_friction(factors, joints, v, workspace, h)
    return v, joints


@settings(max_examples=EXAMPLES)
@given(st.integers(1, 5), st.integers(0, 10**6))
def test_the_speeds_are_those_of_the_box_problem(n, seed):
    """v = v_free - h M^-1 l with Pinocchio's M, whether joints slide on, turn round or stick."""
    (model, rng), h = random_chain(seed, n), 1e-2
    q, v_free = rng.normal(size=(2, n)) * np.array([[1.0], [rng.choice([0.01, 3.0])]])
    dry = rng.uniform(0.0, 2.0, n) * rng.integers(0, 2, n)
    v, joints = rubbed(model, q, v_free, dry, rng.integers(0, 2, n), h)
    m, force, stuck = mass_matrix(model, q), joints["friction"], joints["stuck"] > 0
    free = v_free - h * np.linalg.solve(m, force)
    size = 100.0 * (1e-12 + 1e-14 * np.linalg.cond(m)) * max(1.0, np.abs(v_free).max())
    assert np.abs(v - np.where(stuck, 0.0, free)).max() < size
    assert np.abs(free[stuck]).max(initial=0.0) < size
    assert (v[stuck] == 0.0).all()
    assert (np.abs(force) <= dry).all()
    assert (force * v >= 0.0).all()
    slides = ~stuck & (dry > 0.0) & (v != 0.0)
    assert (force[slides] == (dry * np.sign(v))[slides]).all()
    assert v @ m @ v <= (1.0 + 1e-12) * (v_free @ m @ v_free)


def solved(response, v_free, guess):
    n = len(v_free)
    joints, speed, side, force = plant_joints(np.ones(n), guess), *np.zeros((3, n))
    plant.stick_slip(response, joints, v_free, speed, side, force, np.zeros((n, n)))
    return joints, speed


def test_it_ends_where_the_block_rounds_go_in_circles():
    """Joints so coupled that exchanging all at fault cycles, as Murty's matrix does."""
    n = 7
    upper = 2.0 * np.triu(np.ones((n, n)), 1) + np.eye(n)
    response = upper @ upper.T
    rng = np.random.default_rng(0)
    for _ in range(60):
        v_free = response @ rng.normal(size=n) * rng.choice([0.5, 1.0, 2.0])
        joints, speed = solved(response, v_free, rng.integers(0, 2, n))
        force, stuck = joints["friction"], joints["stuck"] > 0
        assert (np.abs(force) <= 1.0).all()
        assert (force * speed >= -1e-12).all()
        assert (v_free - response @ force)[stuck] == pytest.approx(0.0, abs=1e-7)


def test_a_speed_that_is_rounding_of_zero_is_zero():
    for v_free in (1.0 - 1e-13, 1.0, 0.0):
        joints, speed = solved(np.ones((1, 1)), np.array([v_free]), np.zeros(1))
        assert speed[0] == 0.0
        assert joints["friction"][0] == pytest.approx(v_free, abs=1e-12)
