"""The joints that an arm may have: they turn about an axis, or slide along one."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Check, FloatArray
from fpid_pin.exceptions import ArgumentError

Numbers = tuple[float, ...]
REVOLUTE, PRISMATIC = "revolute", "prismatic"
#: Of a coordinate, by the kind of its joint; an effort is [N m] or [N].
UNITS = {REVOLUTE: "rad", PRISMATIC: "m"}
EFFORT_UNITS = {REVOLUTE: "N m", PRISMATIC: "N"}
_TURNING = ("RX", "RY", "RZ", "RevoluteUnaligned")
_UNBOUNDED = ("RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned")
_SLIDING = ("PX", "PY", "PZ", "PrismaticUnaligned")


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
    for name, unit in zip("XYZ", np.eye(3), strict=True):
        # Pinocchio has faster code for these.
        if np.array_equal(axis, unit):
            return getattr(pin, f"JointModel{'R' if kind == REVOLUTE else 'P'}{name}")()
    return getattr(pin, f"JointModel{kind.title()}Unaligned")(axis)


def displacement(kind: str, axis: FloatArray, value: float) -> Any:
    """Return where a joint takes its frame at a value [rad] or [m], a ``pinocchio.SE3``."""
    if kind == PRISMATIC:
        return pin.SE3(np.eye(3), value * axis)
    return pin.SE3(pin.AngleAxis(value, axis).matrix(), np.zeros(3))


def rows_of(placement: Any) -> tuple[Numbers, ...]:
    """Return a ``pinocchio.SE3`` as the upper three rows of its (4, 4) matrix."""
    return tuple(tuple(row) for row in np.asarray(placement.homogeneous)[:3].tolist())


def placement_of(rows: ArrayLike) -> Any:
    """Build a ``pinocchio.SE3`` from three rows of four numbers."""
    matrix = np.array(rows, dtype=np.float64)
    return pin.SE3(np.array(matrix[:, :3]), np.array(matrix[:, 3]))


def _placement(name: str, value: Any) -> FloatArray:
    rows = checks.floats(name, value, shape=(3, 4))
    rotation = rows[:, :3]
    small = np.abs(rotation).max() < 2.0
    near = small and np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    if not near or np.linalg.det(rotation) < 0.0:
        raise ArgumentError(name, "a rotation in its first three columns", rotation.tolist())
    return rows


Placement = Annotated[ArrayLike, Check(_placement, "m")]


def link_of(model: Any, joint: int) -> str:
    """Return the name of the link that `joint` moves."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[joint])
