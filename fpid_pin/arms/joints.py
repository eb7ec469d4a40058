"""The joints that an arm may have: they turn about an axis, or slide along one."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, named

REVOLUTE, PRISMATIC = "revolute", "prismatic"
#: Of a coordinate, by the kind of its joint; an effort is [N m] or [N].
UNITS = {REVOLUTE: "rad", PRISMATIC: "m"}
EFFORT_UNITS = {REVOLUTE: "N m", PRISMATIC: "N"}
_TURNING = ("RX", "RY", "RZ", "RevoluteUnaligned")
_UNBOUNDED = ("RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned")
_SLIDING = ("PX", "PY", "PZ", "PrismaticUnaligned")
_ALIGNED = {
    REVOLUTE: (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ),
    PRISMATIC: (pin.JointModelPX, pin.JointModelPY, pin.JointModelPZ),
}
_WORDS = {
    "FreeFlyer": "a free joint (an arm's base is fixed)",
    "Composite": "several joints in one (put a body between them)",
    "Mimic": "one that mimics another (lock it)",
}


def kind_of(joint: Any) -> str:
    """Return the kind of one of a Pinocchio model's joints; of one that is neither, its class."""
    name = str(joint.shortname()).removeprefix("JointModel")
    if name in _TURNING or name in _UNBOUNDED:
        return REVOLUTE
    return PRISMATIC if name in _SLIDING else name


def is_unbounded(joint: Any) -> bool:
    """Return whether a joint's coordinates are (cos, sin) of its angle."""
    return str(joint.shortname()).removeprefix("JointModel") in _UNBOUNDED


def axis_of(joint: Any) -> FloatArray:
    """Return the axis that a joint turns about or slides along, in its own frame, (3,)."""
    data = joint.createData()
    joint.calc(data, np.eye(joint.nq)[0] if joint.nq > 1 else np.zeros(joint.nq))
    motion = np.array(data.S, dtype=np.float64).reshape(6)
    return motion[:3] if kind_of(joint) == PRISMATIC else motion[3:]


def joint_model(kind: str, axis: FloatArray) -> Any:
    """Return Pinocchio's joint of this kind about or along a unit vector, (3,)."""
    for k, aligned in enumerate(_ALIGNED[kind]):
        # Pinocchio has faster code for these.
        if np.array_equal(axis, np.eye(3)[k]):
            return aligned()
    unaligned = {
        REVOLUTE: pin.JointModelRevoluteUnaligned,
        PRISMATIC: pin.JointModelPrismaticUnaligned,
    }
    return unaligned[kind](axis)


def require_one_axis(model: Any, label: str) -> None:
    """Refuse, by name, a joint that neither turns about nor slides along one axis.

    Raises
    ------
    ArmError
        Also where such an axis is not a unit vector: its coordinate would not be an angle or a
        length.
    """
    for k in range(1, model.njoints):
        joint, name = model.joints[k], named(str(model.names[k]))
        kind = kind_of(joint)
        if kind not in UNITS:
            raise ArmError(
                f"{cut(label)}: joint {name}: expected revolute, continuous or prismatic, got "
                f"{_WORDS.get(kind, kind)}"
            )
        axis = axis_of(joint)
        if not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
            raise ArmError(
                f"{cut(label)}: joint {name}: expected a unit vector as its axis, got "
                f"{axis.tolist()}"
            )
