"""Arms from Pinocchio's own models: the same mechanics, and a table that needs nothing else."""

import json

import numpy as np
import pinocchio as pin
import pytest

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.arms import Arm
from fpid_pin.exceptions import ArgumentError, ArmError

BODY = pin.Inertia(1.0, np.array([0.1, 0.0, 0.02]), np.diag([0.02, 0.03, 0.04]))


def chain(*joints, inertia=BODY):
    model = pin.Model()
    model.name = "made"
    parent, rng = 0, np.random.default_rng(3)
    for k, joint in enumerate(joints, start=1):
        place = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-1, 1, 3)), rng.uniform(-0.3, 0.3, 3))
        parent = model.addJoint(parent, joint, place, f"j{k}")
        model.addJointFrame(parent)
        model.appendBodyToJoint(parent, inertia, pin.SE3.Identity())
        model.addBodyFrame(f"l{k}", parent, pin.SE3.Identity(), -1)
    return model


def mixed():
    oblique = np.array([0.48, -0.6, 0.64])
    model = chain(
        pin.JointModelRY(), pin.JointModelPrismaticUnaligned(oblique),
        pin.JointModelRevoluteUnaligned(oblique), pin.JointModelPZ(),
    )  # fmt: skip
    model.armature = np.array([0.1, 0.0, 0.02, 0.0])
    model.upperEffortLimit = np.array([300.0, 200.0, 0.0, 50.0])
    model.upperVelocityLimit = np.array([3.0, 0.0, 2.0, 1.0])
    model.damping = np.array([0.0, 0.3, 0.0, 0.1])
    model.upperDryFrictionLimit = np.array([0.2, 0.0, 0.0, 0.0])
    model.lowerPositionLimit = np.array([-1.0, 0.1, -1e6, -0.5])
    model.upperPositionLimit = np.array([2.0, 0.7, 1e6, 0.5])
    return model


def test_slides_limits_friction_and_rotors_are_read():
    model = mixed()
    arm, q = Arm.from_model(model), np.array([0.3, 0.2, -0.4, 0.1])
    v, a = np.array([0.4, -0.1, 0.7, 0.2]), np.array([1.0, 2.0, -1.0, 0.5])
    assert arm.units == ("rad", "m", "rad", "m")
    expected = pin.rnea(model, model.createData(), q, v, a)
    assert arm.inverse_dynamics(q, v, a) == pytest.approx(expected, rel=1e-12)
    assert arm.effort_limit.tolist() == [300.0, 200.0, np.inf, 50.0]
    assert arm.velocity_limit.tolist() == [3.0, np.inf, 2.0, 1.0]
    assert arm.lower.tolist() == [-1.0, 0.1, -np.inf, -0.5]
    assert arm.viscous_friction.tolist() == [0.0, 0.3, 0.0, 0.1]
    assert arm.dry_friction.tolist() == [0.2, 0.0, 0.0, 0.0]


def test_the_model_is_copied():
    model = mixed()
    arm, before = Arm.from_model(model), model.copy()
    model.inertias[1] = pin.Inertia.Zero()
    assert arm == Arm.from_model(before)


def test_a_run_holds_it_as_a_plain_table(tmp_path):
    arm = Arm.from_model(mixed()).with_payload(0.3)
    table = json.loads(json.dumps(descriptions.to_dict(arm)))
    assert descriptions.from_dict(table, Arm) == arm
    assert set(table) == {"kind", "name", "gravity", "joints", "frames", "tool"}
    experiment = fp.Experiment(arm, fp.references.Hold(arm.home), duration=0.05)
    fp.simulate(experiment, fp.ComputedTorque(100.0, 20.0)).save(tmp_path / "run.npz")
    assert fp.Run.load(tmp_path / "run.npz").arm == arm


def test_a_joint_can_be_locked_and_home_is_the_models():
    model = chain(pin.JointModelRUBZ(), pin.JointModelPX(), pin.JointModelRY())
    model.referenceConfigurations["home"] = np.array([np.cos(2.0), np.sin(2.0), 0.3, -0.2])
    whole, held = Arm.from_model(model), Arm.from_model(model, lock={"j2": 0.3})
    assert whole.home == pytest.approx([2.0, 0.3, -0.2])
    assert held.joint_names == ("j1", "j3")
    assert held.home == pytest.approx([2.0, -0.2])
    assert held.tool_pose(held.home) == pytest.approx(whole.tool_pose(whole.home), abs=1e-14)
    turned = Arm.from_model(model, lock={"j1": 2.0})
    assert turned.tool_pose([0.3, -0.2]) == pytest.approx(whole.tool_pose(whole.home), abs=1e-14)


def test_shapes_come_with_it():
    import coal

    geometry = pin.GeometryModel()
    solids = [
        coal.Box(0.1, 0.2, 0.3), coal.Sphere(0.1), coal.Cylinder(0.1, 0.4), coal.Capsule(0.1, 0.4),
        coal.Cone(0.1, 0.4), coal.Ellipsoid(0.1, 0.2, 0.3),
    ]  # fmt: skip
    for k, solid in enumerate(solids):
        place = pin.SE3(np.eye(3), np.full(3, 0.1 * k))
        geometry.addGeometryObject(pin.GeometryObject(f"s{k}", 2, place, solid))
    arm = Arm.from_model(mixed(), geometry=geometry)
    again = descriptions.from_dict(descriptions.to_dict(arm), Arm)
    drawn = again.visual()[1].geometryObjects
    assert [thing.geometry for thing in drawn] == solids
    given = [thing.placement for thing in geometry.geometryObjects]
    assert [thing.placement for thing in drawn] == given


def heavy(mass, *moments):
    body = pin.Inertia(mass, np.zeros(3), np.eye(3))
    body.inertia = np.diag(moments)
    return body


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"model": chain(pin.JointModelFreeFlyer())}, "joint 'j1': expected revolute, con"),
        ({"model": chain(pin.JointModelRX(), inertia=heavy(np.nan, 1, 1, 1))},
         "link 'l1': expected a finite mass"),
        ({"model": "ur5"}, "model: expected a pinocchio.Model, got str"),
        ({"lock": {"j9": 0.0}}, "lock: expected one of j1, j2, j3, j4, got 'j9'"),
        ({"tool": "hook"}, "tool: expected one of"),
    ],
)  # fmt: skip
def test_what_is_no_arm_and_wrong_arguments_are_named_on_one_line(arguments, message):
    with pytest.raises((ArgumentError, ArmError), match=message) as caught:
        Arm.from_model(**({"model": mixed()} | arguments))
    assert "\n" not in str(caught.value)


TABLE_FAULTS = {
    "key": (("joints", 0, "wheel"), 1, "joints.0.wheel: expected one of the keys"),
    "axis": (("joints", 2, "axis"), [1, 1, 0], "joints.2.axis: expected a unit vector"),
    "mirror": (
        ("joints", 0, "placement"), [[-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0]],
        "joints.0.placement: expected a rotation"),
    "name": (("joints", 0, "name"), "j2", "name: expected names of their own, got 'j2' again"),
}  # fmt: skip


@pytest.mark.parametrize("case", TABLE_FAULTS)
def test_a_wrong_table_is_refused_by_the_key_at_fault(case):
    path, value, message = TABLE_FAULTS[case]
    table = json.loads(json.dumps(descriptions.to_dict(Arm.from_model(mixed()))))
    place = table
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    with pytest.raises((ArgumentError, ArmError), match=message):
        descriptions.from_dict(table, Arm)
