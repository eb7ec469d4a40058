"""From an arm's Pinocchio model to the kernels' bodies, whose frames have the joint's axis as z."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.arms.arm import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.kernels.records import BODY

#: Of a symmetric matrix: xx, xy, xz, yy, yz, zz.
_UPPER = np.triu_indices(3)


def bodies_of(arm: Arm) -> Any:
    """Return the bodies of an arm, (n,) BODY of `kernels.records`; not to be written.

    Each body's frame is turned so that its joint's axis is z; angles, and everything that has one
    number a joint, stay. A joint that neither turns nor slides is an `ArmError`.
    """
    kept = vars(arm)
    if "_bodies" not in kept:
        kept["_bodies"] = _bodies(arm.model)
        kept["_bodies"].flags.writeable = False
    return kept["_bodies"]


def inertial_numbers(bodies: Any) -> FloatArray:
    """Return the ten inertial numbers of each body, (n, 10): m, h (3), and j (6)."""
    names = ["m", "h0", "h1", "h2", "j00", "j01", "j02", "j11", "j12", "j22"]
    return np.stack([bodies[name] for name in names], axis=1)


def _bodies(model: Any) -> Any:
    n = model.nv
    if model.njoints != n + 1 or model.nq != n:
        wrong = next(k for k in range(1, model.njoints) if model.joints[k].nq != 1)
        kind = model.joints[wrong].shortname().removeprefix("JointModel")
        raise ArmError(f"expected revolute and prismatic joints, got {model.names[wrong]} ({kind})")
    bodies = np.zeros(n, BODY)
    data, turned = model.createData(), [np.eye(3)]
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for k in range(1, model.njoints):
        jacobian = np.reshape(pin.getJointJacobian(model, data, k, pin.LOCAL), (6, -1))
        axis = jacobian[:, model.joints[k].idx_v]
        slides = bool(np.abs(axis[:3]).max() > 0.5)
        turned.append(_to_z(axis[:3] if slides else axis[3:]))
        frame, below, at = turned[k], turned[model.parents[k]], model.jointPlacements[k]
        inertia = model.inertias[k]
        rotation, lever = below.T @ at.rotation @ frame, frame.T @ inertia.lever
        steiner = lever @ lever * np.eye(3) - np.outer(lever, lever)
        moments = frame.T @ inertia.inertia @ frame + inertia.mass * steiner
        # In the order of BODY, all at once: field by field it is most of what a plant costs.
        bodies[k - 1] = (
            *rotation.T.ravel(), *(below.T @ at.translation), inertia.mass, *(inertia.mass * lever),
            *moments[_UPPER], model.armature[k - 1], slides,
        )  # fmt: skip
    return bodies


def _to_z(axis: FloatArray) -> FloatArray:
    """Return a rotation that takes z to the unit vector `axis`."""
    z = np.array([0.0, 0.0, 1.0])
    cosine = float(z @ axis)
    if cosine < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    cross = pin.skew(np.cross(z, axis))
    return np.asarray(np.eye(3) + cross + cross @ cross / (1.0 + cosine))
