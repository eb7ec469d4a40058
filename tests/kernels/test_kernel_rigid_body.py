"""The rigid-body kernel against Pinocchio on random trees of turning and sliding joints."""

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fpid_pin.arms.bodies import bodies_of
from fpid_pin.exceptions import ArmError
from fpid_pin.kernels import friction, rigid_body

pytestmark = pytest.mark.kernels


def random_tree(rng, n):
    """Return a model with n joints, each on the last body or on one that carries it.

    Pinocchio's algorithms want the bodies of a branch together.
    """
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
        carriers = [0, *model.supports[model.njoints - 1]]
        parent = int(carriers[rng.integers(len(carriers))])
        added = model.addJoint(parent, joint, pin.SE3.Random(), f"joint{k}")
        model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
    model.gravity.linear = rng.normal(size=3) * 10.0
    model.armature = rng.uniform(0.0, 0.5, model.nv)
    return model


def computed(model, q, v, tau):
    """Return M, C q' + G, q'' and M^-1 tau by the kernel."""
    n = model.nv
    bodies, frames = bodies_of(model), np.zeros(n + 1, rigid_body.FRAME)
    rigid_body.ground(frames, n, np.array(model.gravity.linear))
    bias, mass, a = np.zeros(n), np.zeros((n, n)), np.zeros(n)
    rigid_body.terms(bodies, frames, q, v, bias, mass)
    whole = np.tril(mass) + np.tril(mass, -1).T
    rigid_body.forward_dynamics(bodies, frames, q, v, tau, mass, a)
    x = tau.copy()
    rigid_body.solve_tree(bodies, mass, x)
    return whole, bias, a, x


@settings(max_examples=200)
@given(st.integers(1, 9), st.integers(0, 10**6))
def test_random_trees_move_as_pinocchio_has_them(n, seed):
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    model = random_tree(rng, n)
    data = model.createData()
    q, v, tau = rng.normal(size=(3, n)) * 2.0
    mass, bias, a, x = computed(model, q, v, tau)
    m = pin.crba(model, data, q)
    m = np.triu(m) + np.triu(m, 1).T
    size = np.abs(m).max()
    assert np.abs(mass - m).max() < 1e-11 * size
    h = pin.rnea(model, data, q, v, np.zeros(n))
    assert np.abs(bias - h).max() < 1e-11 * max(np.abs(h).max(), size)
    # What solving makes of rounding grows with the condition of M.
    loss = 1e-14 * np.linalg.cond(m) + 1e-11
    exact = pin.aba(model, data, q, v, tau)
    assert np.abs(a - exact).max() < loss * np.abs(exact).max() * 10.0
    assert np.abs(m @ x - tau).max() < loss * np.abs(tau).max() * 10.0


def test_many_runs_have_the_bits_of_each_alone():
    rng = np.random.default_rng(1)
    pin.seed(1)
    models = [random_tree(rng, 4) for _ in range(3)]
    bodies = np.array([bodies_of(m) for m in models])
    gravity = np.array([m.gravity.linear for m in models])
    frames, mass, n = np.zeros(5, rigid_body.FRAME), np.zeros((4, 4)), 4
    own, alive = np.array([2, 0, 1, 0]), np.array([True, True, True, False])
    q, v, tau = rng.normal(size=(3, 4, n))
    a = np.full((4, n), 7.0)
    rigid_body.accelerations(alive, own, bodies, gravity, frames, q, v, tau, mass, a)
    assert (a[3] == 7.0).all()
    for r in range(3):
        assert (a[r] == computed(models[own[r]], q[r], v[r], tau[r])[2]).all()


def test_a_joint_of_another_kind_is_named():
    model = pin.Model()
    added = model.addJoint(0, pin.JointModelSpherical(), pin.SE3.Identity(), "ball")
    model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
    with pytest.raises(ArmError, match=r"revolute and prismatic joints, got ball \(Spherical\)"):
        bodies_of(model)


@settings(max_examples=80)
@given(st.integers(1, 5), st.integers(0, 10**6))
def test_dry_friction_of_one_robot_leaves_the_speeds_of_the_box_problem(n, seed):
    """v = v_free - h M^-1 f with Pinocchio's M, whether joints slide on, turn round or stick."""
    rng = np.random.default_rng(seed)
    pin.seed(seed)
    model, h = random_tree(rng, n), 1e-2
    q, v_free, tau = rng.normal(size=(3, n)) * np.array([[1.0], [rng.choice([0.01, 3.0])], [1.0]])
    m = pin.crba(model, model.createData(), q)
    m = np.triu(m) + np.triu(m, 1).T
    bodies, frames = bodies_of(model), np.zeros(n + 1, rigid_body.FRAME)
    rigid_body.ground(frames, n, np.array(model.gravity.linear))
    mass, a = np.zeros((n, n)), np.zeros(n)
    rigid_body.forward_dynamics(bodies, frames, q, v_free, tau, mass, a)
    dry = rng.uniform(0.0, 2.0, n) * rng.integers(0, 2, n)
    v, stuck, force = v_free.copy(), rng.integers(0, 2, n).astype(bool), np.zeros(n)
    friction.rub(
        bodies, mass, dry, stuck, force, v, np.zeros((3, n)), np.zeros((n, n)), np.zeros((n, n)), h
    )  # fmt: skip
    free = v_free - h * np.linalg.solve(m, force)
    size = (1e-12 + 1e-14 * np.linalg.cond(m)) * max(1.0, np.abs(v_free).max())
    assert np.abs(v - np.where(stuck, 0.0, free)).max() < 100.0 * size
    assert np.abs(free[stuck]).max(initial=0.0) < 100.0 * size
    assert (np.abs(force) <= dry).all()
    assert (force * v >= 0.0).all()
    slides = ~stuck & (dry > 0.0) & (v != 0.0)
    assert (force[slides] == (dry * np.sign(v))[slides]).all()
