"""example-robot-data's arms: those that work, held against the data package's own loaders."""

import numpy as np
import pinocchio as pin
import pytest
from bounded import FULL

from fpid_pin import descriptions
from fpid_pin.arms import Arm, catalogue, names
from fpid_pin.cli.arms import arm_rows
from fpid_pin.exceptions import ArgumentError

#: All of them in `make torture`; else one of each kind: continuous joints, locked ones, rotors,
#: one that the data package has otherwise.
NAMES = names() if FULL else ("ur5_limited", "kinova", "panda", "talos_arm", "so100")
#: Of a name here, the data package's loader gives another robot (ur3 is a UR5 there) or a
#: floating base (the SO arms).
OTHER = {"ur3", "so100", "so101"}


def loaded(name):
    """The data package's own model, without the cost of its meshes; and its q0."""
    from example_robot_data import robots_loader

    cls = robots_loader.ROBOTS[name]
    root = robots_loader.getModelPath(f"{cls.path}/{cls.urdf_subpath}/{cls.urdf_filename}")
    model = pin.buildModelFromUrdf(f"{root}/{cls.path}/{cls.urdf_subpath}/{cls.urdf_filename}")
    q0 = pin.neutral(model)
    if cls.srdf_filename:
        srdf = f"{root}/{cls.path}/{cls.srdf_subpath}/{cls.srdf_filename}"
        q0 = robots_loader.readParamsFromSrdf(
            model, srdf, False, cls.has_rotor_parameters, cls.ref_posture
        )
    return model, q0


def to_circle(model, q):
    """Angles as the data package's coordinates: (cos, sin) for continuous joints."""
    out = np.zeros(model.nq)
    for joint, angle in zip(list(model.joints)[1:], q, strict=True):
        both = [np.cos(angle), np.sin(angle)] if joint.nq == 2 else [angle]
        out[joint.idx_q : joint.idx_q + joint.nq] = both
    return out


@pytest.mark.parametrize("name", NAMES)
def test_every_arm_is_a_chain_of_angles_with_home_inside_its_limits(name):
    arm = Arm.from_example(name)
    assert arm.name == name
    assert arm.model.nq == arm.model.nv == arm.n == len(arm.joint_names)
    assert (arm.lower <= arm.home).all()
    assert (arm.home <= arm.upper).all()
    assert (arm.effort_limit > 0).all()
    assert (arm.viscous_friction >= 0).all()
    assert np.linalg.eigvalsh(arm.mass_matrix(arm.home))[0] > 1e-6
    assert name in arm.credit
    assert descriptions.from_dict(descriptions.to_dict(arm), Arm) == arm


@pytest.mark.parametrize("name", sorted(set(NAMES) - OTHER))
def test_dynamics_and_home_are_those_of_the_data_package(name):
    arm = Arm.from_example(name)
    whole, q0 = loaded(name)
    held = [k for k in range(1, whole.njoints) if str(whole.names[k]) not in arm.joint_names]
    model = whole
    if held:
        lock = catalogue.ENTRIES[name].lock
        still = pin.neutral(whole)
        for k in held:
            still[whole.joints[k].idx_q] = lock[str(whole.names[k])]
        model = pin.buildReducedModel(whole, held, still)
    data = model.createData()
    rng = np.random.default_rng(0)
    for _ in range(20):
        q, v, a = rng.uniform(-3, 3, arm.n), rng.normal(size=arm.n), rng.normal(size=arm.n)
        tau = pin.rnea(model, data, to_circle(model, q), v, a)
        np.testing.assert_allclose(arm.inverse_dynamics(q, v, a), tau, rtol=1e-12, atol=1e-12)
    keep = [k for k in range(1, whole.njoints) if k not in held]
    for k, home in zip(keep, arm.home, strict=True):
        joint = whole.joints[k]
        part = q0[joint.idx_q : joint.idx_q + joint.nq]
        angle = np.arctan2(part[1], part[0]) if joint.nq == 2 else part[0]
        turns = (home - angle) / (2 * np.pi)
        assert abs(turns - round(turns)) < 1e-4


def test_what_is_known_of_some_arms():
    ur3, ur5 = Arm.from_example("ur3"), Arm.from_example("ur5")
    reach = [np.linalg.norm(arm.tool_pose(np.zeros(6))[:3, 3]) for arm in (ur3, ur5)]
    assert 0.4 < reach[0] < 0.7 < reach[1]
    panda = Arm.from_example("panda")
    assert (panda.n, panda.tool, panda.home[3]) == (7, "panda_hand", -2.3562)
    assert panda.effort_limit.tolist() == [87] * 4 + [12] * 3
    assert Arm.from_example("talos_arm").armature.tolist() == [0.1] * 6 + [0.0]


def test_more_joints_can_be_locked():
    arm = Arm.from_example("panda", lock={"panda_joint7": 0.5})
    assert arm.n == 6
    assert arm.home.tolist() == Arm.from_example("panda").home[:6].tolist()
    assert Arm.from_example("talos_arm", lock={"gripper_left_joint": 0}).armature.sum() == 0.6
    assert descriptions.from_dict(descriptions.to_dict(arm), Arm) == arm
    with pytest.raises(ArgumentError, match=r"did you mean panda_joint7\?"):
        Arm.from_example("panda", lock={"panda_joint77": 0.5})


def test_the_table_lists_every_arm():
    rows = {row["name"]: list(row.values())[1:] for row in arm_rows()}
    assert list(rows) == ["two_link", *names()]
    assert rows["ur5"][:4] == [6, "150 x3, 28 x3", "-", "-"]
    assert rows["two_link"][1] == "-"
