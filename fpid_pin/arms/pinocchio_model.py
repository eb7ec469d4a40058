"""A Pinocchio model, checked and written out as the plain table of `ModelSource`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import solids
from fpid_pin.arms.chain import link_of, require_serial
from fpid_pin.arms.inertia import row_of
from fpid_pin.arms.joints import axis_of, is_unbounded, kind_of, require_one_axis
from fpid_pin.arms.model import FRAMES, LIMITS, LOSSES, ModelSource
from fpid_pin.arms.physical import require_physical
from fpid_pin.arms.source import limits_of, one_line
from fpid_pin.arms.urdf_tree import MOST_JOINTS
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, ArmError
from fpid_pin.text import cut, named, shown

_TYPES = {kind: name for name, kind in FRAMES.items()}


def source_of(
    model: Any,
    *,
    label: str,
    lock: Mapping[str, float] | None = None,
    gravity: ArrayLike | None = None,
    geometry: Any = None,
    tool: str | None = None,
) -> ModelSource:
    """Write a Pinocchio model out; it stays as it is.

    Parameters
    ----------
    model
        A ``pinocchio.Model``.
    label
        What to call it in an error.
    lock
        Joints to hold still, and where [rad] or [m].
    gravity
        (3,) or a number (downwards) [m/s^2]; None: the model's.
    geometry
        Its visual ``pinocchio.GeometryModel``; None: none.
    tool
        A frame's name; None: one called ``tool``, else the last.

    Raises
    ------
    ArmError
        A joint without one axis, a tree, numbers that no arm has.
    """
    lock = _checked_lock({} if lock is None else lock, model)
    if model.njoints - 1 > MOST_JOINTS:
        raise ArmError(
            f"{cut(label)}: expected at most {MOST_JOINTS} joints, got {model.njoints - 1}"
        )
    bodies = list(model.inertias)[1:]
    links = [link_of(model, k) for k in range(1, model.njoints)]
    # Before locking: a link that no body is like may vanish within another.
    require_physical(
        links, [b.mass for b in bodies], [np.array(b.inertia) for b in bodies], cut(label)
    )
    model, geometry = _reduced(model, geometry, lock, label)
    require_one_axis(model, label)
    require_serial(model, label)
    try:
        return ModelSource(
            joints=_joints(model, label),
            frames=_frames(model),
            shapes=[] if geometry is None else solids.rows_of(geometry.geometryObjects),
            name=str(model.name) or "arm",
            gravity=np.array(model.gravity.linear) if gravity is None else gravity,
            home=_home(model),
            tool=tool or ("tool" if model.existFrame("tool") else None),
        )
    except ArgumentError as error:
        raise ArmError(f"{cut(label)}: {error}") from None


def _checked_lock(lock: Any, model: Any) -> dict[str, float]:
    if not isinstance(lock, Mapping):
        raise ArgumentError("lock", "a table {joint: value}", shown(lock))
    known = [str(name) for name in list(model.names)[1:]]
    return {
        checks.choice("lock", name, known): checks.number(f"lock.{name}", value)
        for name, value in lock.items()
    }


def _reduced(model: Any, geometry: Any, lock: Mapping[str, float], label: str) -> tuple[Any, Any]:
    """Return copies of a model and its geometry with joints held where `lock` says."""
    if not lock:
        return model.copy(), geometry
    q = pin.neutral(model)
    for name, value in lock.items():
        joint = model.joints[model.getJointId(name)]
        if joint.nv != 1:
            raise ArmError(
                f"{cut(label)}: joint {named(name)}: expected a joint with one coordinate to lock, "
                f"got {kind_of(joint)}"
            )
        turned = is_unbounded(joint)
        q[joint.idx_q : joint.idx_q + joint.nq] = (
            (np.cos(value), np.sin(value)) if turned else value
        )
    held = [model.getJointId(name) for name in lock]
    with one_line(label, "its joints cannot be locked"):
        if geometry is None:
            return pin.buildReducedModel(model, held, q), None
        reduced, (drawn,) = pin.buildReducedModel(model, [geometry], held, q)
    return reduced, drawn


def _joints(model: Any, label: str) -> list[dict[str, Any]]:
    arrays = _limits(model)
    arrays["armature"] = np.array(model.armature, dtype=np.float64)
    for key, values in arrays.items():
        bad = np.isnan(values)
        if key not in LIMITS:
            bad |= ~np.isfinite(values) | (values < 0.0)
        if bad.any():
            name = named(str(model.names[int(np.argmax(bad)) + 1]))
            raise ArmError(
                f"{cut(label)}: joint {name}: expected {key} >= 0, got {values[bad][0]:g}"
            )
    joints = []
    for k in range(1, model.njoints):
        joint: dict[str, Any] = {
            "name": str(model.names[k]),
            "kind": kind_of(model.joints[k]),
            "axis": axis_of(model.joints[k]).tolist(),
            "placement": solids.placement_rows(model.jointPlacements[k]),
            "inertia": row_of(model.inertias[k]),
        }
        for key, values in arrays.items():
            value = float(values[k - 1])
            if np.isfinite(value) and (key in ("lower", "upper") or value != 0.0):
                joint[key] = value
        joints.append(joint)
    return joints


def _limits(model: Any) -> dict[str, FloatArray]:
    """Return limits and friction, (n,), by the keys of a joint's table."""
    bounds = [np.zeros(model.nv), np.zeros(model.nv)]
    for k in range(1, model.njoints):
        joint = model.joints[k]
        if not is_unbounded(joint):
            bounds[0][k - 1] = model.lowerPositionLimit[joint.idx_q]
            bounds[1][k - 1] = model.upperPositionLimit[joint.idx_q]
    found = limits_of(model, *bounds)
    return {key: found[field] for key, field in (LIMITS | LOSSES).items()}


def _frames(model: Any) -> list[dict[str, Any]]:
    taken = {str(name) for name in model.names}
    frames = []
    for frame in list(model.frames)[1:]:
        name = str(frame.name)
        if frame.type not in _TYPES:
            continue
        if name in taken:
            # Pinocchio cannot tell frames of one name apart.
            name = f"{name}_link"
            if name in taken:
                continue
        taken.add(name)
        frames.append(
            {
                "name": name,
                "joint": int(frame.parentJoint) - 1,
                "type": _TYPES[frame.type],
                "placement": solids.placement_rows(frame.placement),
            }
        )
    return frames


def _home(model: Any) -> FloatArray | None:
    """Return the reference configuration called ``home`` (MuJoCo's keyframe), (n,), if any."""
    poses = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    if "home" not in poses:
        return None
    q = np.array(poses["home"], dtype=np.float64)
    if q.shape != (model.nq,) or not np.isfinite(q).all():
        return None
    angles = []
    for k in range(1, model.njoints):
        joint = model.joints[k]
        at = q[joint.idx_q : joint.idx_q + joint.nq]
        angles.append(float(np.arctan2(at[1], at[0]) if is_unbounded(joint) else at[0]))
    return np.array(angles)
