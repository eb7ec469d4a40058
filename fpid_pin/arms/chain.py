"""What every arm must be: a serial chain whose mass matrix can be inverted."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, listed, named

#: Poses at which the mass matrix is tried, besides the arm's zero and home.
_POSES = 4
#: Smallest admissible ratio of the mass matrix's extreme eigenvalues (rounding alone gives 1e-16).
_SINGULAR = 1e-14


def require_serial(model: Any, name: str) -> None:
    """Refuse a tree: each joint must hang from the one before it.

    Raises
    ------
    ArmError
        Naming the joint at which the arm branches, and the joints that leave it.
    """
    if model.njoints < 2:
        raise ArmError(f"{cut(name)}: expected at least one joint that is free to move, got none")
    children: dict[int, list[str]] = {}
    for joint in range(1, model.njoints):
        children.setdefault(int(model.parents[joint]), []).append(str(model.names[joint]))
    for parent, names in children.items():
        if len(names) > 1:
            where = "its base" if parent == 0 else f"joint {named(str(model.names[parent]))}"
            raise ArmError(
                f"{cut(name)}: expected a serial chain, got a tree that branches at {where} into "
                f"{listed(names)} (lock the joints of all branches but one)"
            )


def require_regular(model: Any, name: str, home: Any) -> None:
    """Refuse an arm with massless links that leave the mass matrix singular.

    Tried at the zero pose, at home and at a few seeded poses: a massless elbow, say, is regular
    while the arm is bent and singular when it is straight.

    Raises
    ------
    ArmError
        Naming the link.
    """
    data = model.createData()
    random = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSES, model.nv))
    for q in np.vstack((np.zeros(model.nv), home, random)):
        upper = np.triu(pin.crba(model, data, q))
        mass = upper + np.triu(upper, 1).T
        if not np.isfinite(mass).all():
            raise ArmError(
                f"{cut(name)}: expected finite inertias, got a mass matrix with NaN or inf"
            )
        values, vectors = np.linalg.eigh(mass)
        if values[0] > _SINGULAR * max(values[-1], np.finfo(np.float64).tiny):
            continue
        # The direction in which nothing moves: the culprit is a massless link that takes part in
        # it, or else the link that moves most.
        share = np.abs(vectors[:, 0])
        bodies = list(model.inertias)[1:]
        idle = [k for k, body in enumerate(bodies) if body.mass <= 0.0 and share[k] > 1e-6]
        joint = (idle[0] if idle else int(np.argmax(share))) + 1
        raise ArmError(
            f"{cut(name)}: expected a positive definite mass matrix, got smallest eigenvalue "
            f"{values[0]:.3g}: link {named(link_of(model, joint))} (moved by joint "
            f"{named(str(model.names[joint]))}) has too little mass or inertia"
        )


def link_of(model: Any, joint: int) -> str:
    """Return the name of the link that `joint` moves."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[joint])


def last_frame(model: Any) -> str:
    """Return the frame at the arm's end: the last body fixed to the last joint."""
    last = model.njoints - 1
    bodies = [
        str(frame.name)
        for frame in model.frames
        if frame.parentJoint == last and frame.type == pin.FrameType.BODY
    ]
    return bodies[-1] if bodies else str(model.names[last])
