"""What holds for every arm: structure of M and C, energies, changes, tables, pickles."""

import json
import pickle
import tomllib

import numpy as np
import pinocchio as pin
import pytest
import tomli_w
from hypothesis import given, settings
from hypothesis import strategies as st

from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError

ARMS = {
    "two_link": Arm.two_link(),
    "planar": Arm.planar((0.4, 0.3, 0.2, 0.5), (1, 2, 0.5, 0.3), rods=True),
    "ur5": Arm.from_example("ur5"),
    "panda": Arm.from_example("panda"),
    "talos_arm": Arm.from_example("talos_arm"),
}
every_arm = pytest.mark.parametrize("arm", [ARMS[name] for name in ("planar", "talos_arm")])


def state(arm, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform(-2, 2, arm.n), rng.normal(size=arm.n), rng.normal(size=arm.n)


@every_arm
def test_mass_rate_less_twice_coriolis_is_skew(arm):
    q, v, _ = state(arm)
    h = 1e-6
    rate = (arm.mass_matrix(q + h * v) - arm.mass_matrix(q - h * v)) / (2 * h)
    c = arm.coriolis_matrix(q, v)
    np.testing.assert_allclose(c + c.T, rate, atol=1e-6)


@every_arm
def test_tool_jacobian_is_the_slope_of_the_tool_pose(arm):
    q, v, _ = state(arm)
    h = 1e-6
    ahead, behind = arm.tool_pose(q + h * v), arm.tool_pose(q - h * v)
    twist = arm.tool_jacobian(q) @ v
    np.testing.assert_allclose(twist[:3], (ahead - behind)[:3, 3] / (2 * h), atol=1e-7)
    turn = (ahead - behind)[:3, :3] / (2 * h) @ arm.tool_pose(q)[:3, :3].T
    np.testing.assert_allclose(twist[3:], [turn[2, 1], turn[0, 2], turn[1, 0]], atol=1e-7)


@every_arm
def test_a_table_goes_through_json_and_toml_and_back_and_an_arm_through_a_pickle(arm):
    changed = (
        arm.with_payload(1.5, (0.0, 0.1, 0.02), inertia=np.diag((0.01, 0.02, 0.02)))
        .with_friction(viscous=0.3, dry=0.1)
        .with_limits(effort=np.where(np.arange(arm.n) == 0, 0.0, 40.0))
        .with_gravity(3.7)
        .with_armature(0.01)
        .perturbed(np.random.default_rng(3), com=0.01, inertia=0.1, friction=0.2)
        .with_scaled_links(1.5, inertia=2.0)
    )
    for one in (arm, changed):
        table = descriptions.to_dict(one)
        assert descriptions.from_dict(json.loads(json.dumps(table, allow_nan=False)), Arm) == one
        assert descriptions.from_dict(tomllib.loads(tomli_w.dumps(table)), Arm) == one
        assert pickle.loads(pickle.dumps(one)) == one
    assert changed != arm


def test_arms_are_unequal_where_anything_differs():
    arm = ARMS["ur5"]
    assert arm == Arm.from_example("ur5")
    assert hash(arm) == hash(Arm.from_example("ur5"))
    for other in (
        arm.with_payload(1e-9),
        arm.with_friction(dry=1),
        arm.with_limits(effort=1),
        arm.with_limits(velocity=1),
        arm.with_gravity(9.8),
        arm.with_armature(1e-9),
        Arm.from_example("ur5_limited"),
    ):
        assert other != arm
    assert arm != "ur5"


@every_arm
def test_payload_is_the_composition_of_inertias(arm):
    """Independent truth: the payload's own energy from the tool's Jacobian, added to the arm's."""
    mass, com, about = 1.7, np.array((0.02, -0.03, 0.1)), np.diag((0.02, 0.03, 0.04))
    loaded = arm.with_payload(mass, com, inertia=about)
    for seed in range(5):
        q, v, _ = state(arm, seed)
        twist, pose = arm.tool_jacobian(q) @ v, arm.tool_pose(q)
        lever = pose[:3, :3] @ com
        speed = twist[:3] + np.cross(twist[3:], lever)
        spin = pose[:3, :3].T @ twist[3:]
        energy = 0.5 * mass * speed @ speed + 0.5 * spin @ about @ spin
        expected = 0.5 * v @ arm.mass_matrix(q) @ v + energy
        assert 0.5 * v @ loaded.mass_matrix(q) @ v == pytest.approx(expected, rel=1e-10)
        height = mass * arm.gravity * (pose[:3, 3] + lever)[2]
        before, after = (
            pin.computePotentialEnergy(a.model, a.model.createData(), q) for a in (arm, loaded)
        )
        assert after - before == pytest.approx(height, rel=1e-9, abs=1e-10)
    assert arm.with_payload(0.0) == arm


def test_payload_may_sit_at_any_frame():
    at_elbow = ARMS["two_link"].with_payload(1.0, (1.0, 0.0, 0.0), frame="link1")
    expected, rest = Arm.planar((1.0, 0.8), (2.0, 1.0)), np.zeros(2)
    tau = (arm.inverse_dynamics((0.3, 0.7), rest, (1.0, 2.0)) for arm in (at_elbow, expected))
    assert next(tau) == pytest.approx(next(tau), abs=1e-13)


def consistent(inertia):
    """The pseudo-inertia of a rigid body is positive semidefinite; its mass positive."""
    second = np.array(inertia.inertia)
    moments = np.linalg.eigvalsh(second)
    slack = 1e-9 * max(moments[2], 1e-12)
    return inertia.mass > 0 and moments[0] >= -slack and moments[:2].sum() >= moments[2] - slack


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    mass=st.floats(0, 0.99),
    com=st.floats(0, 0.1),
    inertia=st.floats(0, 0.99),
)
def test_perturbed_arm_is_physically_consistent(seed, mass, com, inertia):
    arm = ARMS["panda"]
    other = arm.perturbed(np.random.default_rng(seed), mass=mass, com=com, inertia=inertia)
    before, after = list(arm.model.inertias)[1:], list(other.model.inertias)[1:]
    again = arm.perturbed(np.random.default_rng(seed), mass=mass, com=com, inertia=inertia)
    assert again == other
    for one, two in zip(before, after, strict=True):
        assert abs(two.mass / one.mass - 1) <= mass + 1e-12
        assert np.abs(two.lever - one.lever).max() <= com + 1e-12
        if consistent(one):
            assert consistent(two)
    assert np.linalg.eigvalsh(other.mass_matrix(other.home))[0] > 0


def test_friction_and_limits_are_kept_beside_the_rigid_body():
    arm = ARMS["two_link"].with_friction(viscous=(0.1, 0.2), dry=0.5).with_limits(effort=(0, 30))
    assert arm.viscous_friction.tolist() == [0.1, 0.2]
    assert arm.dry_friction.tolist() == [0.5, 0.5]
    assert arm.effort_limit.tolist() == [np.inf, 30]
    assert arm.model.damping.tolist() == [0.1, 0.2]
    q, v, a = state(arm)
    expected = ARMS["two_link"].forward_dynamics(q, v, a)
    assert np.array_equal(arm.forward_dynamics(q, v, a), expected)
    assert arm.with_friction(dry=0).viscous_friction.tolist() == [0.1, 0.2]
    assert not ARMS["two_link"].dry_friction.any()


def test_an_arm_cannot_be_altered():
    arm = ARMS["ur5"]
    with pytest.raises(AttributeError):
        arm.name = "mine"
    for name in ("home", "effort_limit", "lower", "dry_friction"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(arm, name)[0] = 1.0


def test_joint_index_by_name_or_number():
    arm = ARMS["panda"]
    assert arm.joint_index("panda_joint3") == 2
    assert arm.joint_index(6) == 6
    with pytest.raises(ArgumentError, match=r"did you mean panda_joint3\?"):
        arm.joint_index("pnda_joint3")
    with pytest.raises(ArgumentError, match=r"joint: .*\[0, 6\], got 7"):
        arm.joint_index(7)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda a: a.mass_matrix([1, 2, 3]), r"q: expected shape \(2,\) .*, got shape \(3,\)"),
        (lambda a: a.forward_dynamics([0, 0], [0, 0], [np.nan, 0]), r"tau\.0: .*got nan"),
        (lambda a: a.with_payload(-1), "mass: expected a number >= 0, got -1"),
        (lambda a: a.with_payload(1, frame="tol"), r"did you mean tool\?"),
        (lambda a: a.with_payload(1, inertia=np.diag((1, 1, 3))), "inertia: .*principal moments"),
        (lambda a: a.with_friction(viscous=-1), "viscous friction: .*>= 0"),
        (lambda a: a.with_limits(effort=-3), "effort limit: .*>= 0"),
        (lambda a: a.with_gravity((1, 2)), r"gravity: expected a number or shape \(3,\)"),
        (lambda a: a.with_payload(1, inertia=np.eye(3, k=1)), "inertia: expected a symmetric matr"),
        (lambda a: a.with_scaled_links(mass=0.0), "mass: expected a number > 0, got 0"),
        (lambda a: a.with_scaled_links(inertia=(1.0, 2.0, 3.0)), r"inertia: expected shape \(2,\)"),
        (lambda a: Arm.planar((1.0, 0.8), (1.0,)), r"masses: expected shape \(2,\)"),
        (lambda a: Arm.planar((1.0, 0.0), (1.0, 1.0)), r"lengths\.1: expected a number > 0, got 0"),
        (lambda a: Arm.planar("long", (1.0,)), "lengths: expected numbers"),
        (lambda a: a.perturbed(7), r"rng: expected a numpy\.random\.Generator, got int"),
    ],
)
def test_bad_arguments_are_named_on_one_line(call, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        call(ARMS["two_link"])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ({"kind": "planer"}, r"did you mean planar\?"),
        ({"kind": "planar", "lengths": [1.0]}, r"arm\.masses: expected a value, got none"),
        ({"kind": "urdf"}, r"path: expected the path of a URDF file, got None"),
        ({"kind": "two_link", "changes": [{"paylod": {}}]}, r"did you mean payload\?"),
        ({"kind": "two_link", "changes": [{"payload": {}}]}, r"payload\.mass: expected a value"),
        ({"kind": "two_link", "changes": [{"payload": {"m": 1}}]}, "expected one of the keys mass"),
        ({"kind": "two_link", "changes": [{"inertias": {"rows": [[1.0]]}}]}, r"shape \(2, 10\)"),
    ],
)
def test_bad_tables_are_named_on_one_line(table, message):
    with pytest.raises(ArgumentError, match=message) as caught:
        descriptions.from_dict(table, Arm)
    assert "\n" not in str(caught.value)


@every_arm
def test_scaled_links_have_factors_of_mass_and_shape(arm):
    factors = np.linspace(0.5, 1.5, arm.n)
    scaled = arm.with_scaled_links(mass=factors, inertia=2.0)
    for j, factor in enumerate(factors, start=1):
        before, after = (a.model.inertias[j] for a in (arm, scaled))
        assert after.mass == factor * before.mass
        assert np.array_equal(after.lever, before.lever)
        assert np.allclose(after.inertia, 2.0 * factor * before.inertia, rtol=1e-15)
