"""A Pinocchio model as a tree of joints."""

from __future__ import annotations

from typing import Any

import numpy as np

from fpid_pin.arms.inertia import row_of
from fpid_pin.arms.joints import UNITS, axis_of, is_unbounded, kind_of, link_of, rows_of
from fpid_pin.arms.shapes import shape_of
from fpid_pin.arms.spec import FRAMES, Frame, Joint
from fpid_pin.arms.tree import UNREACHABLE, Body, Tree
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, named

_TYPES = {kind: name for name, kind in FRAMES.items()}


def tree_of(model: Any, label: str, geometry: Any = None) -> Tree:
    """Return the tree of a ``pinocchio.Model``, with its visual geometry; both stay as they are.

    Raises
    ------
    ArmError
        NaN, or negative friction.
    """
    tree = Tree(label, str(model.name) or "arm", tuple(np.array(model.gravity.linear).tolist()))
    poses = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    home = np.array(poses.get("home", ()), dtype=np.float64)
    use_home = home.shape == (model.nq,) and np.isfinite(home).all()
    for k in range(1, model.njoints):
        joint = model.joints[k]
        tree.joints.append(_joint(model, k, label))
        tree.parents.append(int(model.parents[k]) - 1)
        tree.rest.append(0.0)
        tree.bodies.append(Body(link_of(model, k), k - 1, row_of(model.inertias[k])))
        if use_home and joint.nv == 1:
            at = home[joint.idx_q : joint.idx_q + joint.nq]
            angle = np.arctan2(at[1], at[0]) if is_unbounded(joint) else at[0]
            tree.home[str(model.names[k])] = float(angle)
    tree.frames = frames_of(model)
    tree.tool = "tool" if any(frame.name == "tool" for frame in tree.frames) else None
    for thing in [] if geometry is None else geometry.geometryObjects:
        shape = shape_of(thing)
        tree.shapes += [] if shape is None else [shape]
    return tree


def frames_of(model: Any) -> list[Frame]:
    """Return a model's frames; a link that shares its name with a joint gets another."""
    taken = {str(name) for name in model.names}
    frames = []
    for frame in list(model.frames)[1:]:
        if frame.type in _TYPES:
            kind, joint = _TYPES[frame.type], int(frame.parentJoint) - 1
            name = own_name(str(frame.name), kind, taken)
            frames.append(Frame(name, joint, kind, rows_of(frame.placement)))
    return frames


def own_name(name: str, kind: str, taken: set[str]) -> str:
    """Return a name that none of `taken` has, and add it: Pinocchio cannot tell two apart."""
    while name in taken or not name:
        name = f"{name}_{kind}"
    taken.add(name)
    return name


def limit_of(value: float) -> float:
    """Return a limit [N m] or [rad/s]; 0 and absurd numbers say that there is none."""
    return np.inf if value == 0.0 or value > 1e300 else float(value)


def _joint(model: Any, k: int, label: str) -> Joint:
    joint, name = model.joints[k], str(model.names[k])
    kind, place = kind_of(joint), rows_of(model.jointPlacements[k])
    if kind not in UNITS:
        return Joint(name, kind, (0.0, 0.0, 1.0), place, (0.0,) * 10)
    at, nothing = joint.idx_v, is_unbounded(joint)
    lower = -np.inf if nothing else float(model.lowerPositionLimit[joint.idx_q])
    upper = np.inf if nothing else float(model.upperPositionLimit[joint.idx_q])
    numbers = {
        "effort": limit_of(model.upperEffortLimit[at]),
        "velocity": limit_of(model.upperVelocityLimit[at]),
        "damping": float(model.damping[at]),
        "friction": float(model.upperDryFrictionLimit[at]),
        "armature": float(model.armature[at]),
    }
    for key, value in numbers.items():
        if not value >= 0.0:
            raise ArmError(f"{cut(label)}: joint {named(name)}: expected {key} >= 0, got {value:g}")
    bounds = position_limits(lower, upper)
    axis = tuple(axis_of(joint).tolist())
    return Joint(name, kind, axis, place, (0.0,) * 10, *bounds, **numbers)


def position_limits(lower: float, upper: float) -> tuple[float, float]:
    """Return position limits; an empty range, or one beyond reach, is none."""
    empty = lower >= upper
    lower = -np.inf if empty or lower < -UNREACHABLE else lower
    return lower, np.inf if empty or upper > UNREACHABLE else upper
