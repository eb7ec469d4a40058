"""An arm's model as the records of `kernels.rigid_body`: the same bodies, frames turned to z."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.arms.arm import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError

#: Of a symmetric matrix: xx, xy, xz, yy, yz, zz.
_UPPER = np.triu_indices(3)


def bodies_of(model: Any) -> Any:
    """Return the bodies of a Pinocchio model, (n,) records of `kernels.rigid_body`.

    Each body's frame is turned so that its joint's axis is z; angles, and everything that has one
    number a joint, stay.

    Raises
    ------
    ArmError
        A joint that neither turns about nor slides along one axis.
    """
    # Imported late: it loads numba.
    from fpid_pin.kernels.rigid_body import BODY

    n = model.nv
    if model.njoints != n + 1 or model.nq != n:
        wrong = next(k for k in range(1, model.njoints) if model.joints[k].nq != 1)
        kind = model.joints[wrong].shortname().removeprefix("JointModel")
        raise ArmError(
            f"compiled dynamics: expected revolute and prismatic joints, got {model.names[wrong]} "
            f'({kind}); dynamics = "pinocchio" has it'
        )
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
        parent = n if model.parents[k] == 0 else model.parents[k] - 1
        rotation, lever = below.T @ at.rotation @ frame, frame.T @ inertia.lever
        spread = lever @ lever * np.eye(3) - np.outer(lever, lever)
        moments = frame.T @ inertia.inertia @ frame + inertia.mass * spread
        # In the order of BODY, all at once: field by field it is most of what a plant costs.
        bodies[k - 1] = (
            *rotation.T.ravel(), *(below.T @ at.translation), inertia.mass, *(inertia.mass * lever),
            *moments[_UPPER], model.armature[k - 1], parent, slides,
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


class CompiledFleet:
    """`runs` arms for the kernels: the constants of each distinct plant, and room to work in.

    Parameters
    ----------
    arms
        One a run.
    armature
        Inertia added to the joints' own rotor inertia [kg m^2], (runs, n): friction's h F_v.

    Attributes
    ----------
    model : ndarray of int, (runs,)
        Which of the plants is a run's.
    bodies, gravity
        Records of `kernels.rigid_body`, (plants, n), and g [m/s^2], (plants, 3).
    frames, mass
        Room for frames, (n + 1,), and for M, (n, n).
    """

    def __init__(self, arms: Sequence[Arm], armature: FloatArray) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import rigid_body

        plants: dict[tuple[bytes, bytes], int] = {}
        bodies: list[Any] = []
        gravity: list[FloatArray] = []
        self.model = np.zeros(len(arms), dtype=np.int64)
        for run, (arm, extra) in enumerate(zip(arms, armature, strict=True)):
            key = (arm.dynamics_key(), extra.tobytes())
            if key not in plants:
                plants[key] = len(bodies)
                own = bodies_of(arm.model)
                own["armature"] += extra
                bodies.append(own)
                gravity.append(np.array(arm.model.gravity.linear))
            self.model[run] = plants[key]
        n = arms[0].n
        self.bodies, self.gravity = np.array(bodies), np.array(gravity)
        self.frames = np.zeros(n + 1, rigid_body.FRAME)
        self.mass: FloatArray = np.zeros((n, n))
        self._alive = np.ones(len(arms), dtype=np.bool_)
        self._accelerations: Any = rigid_body.accelerations

    def forward_dynamics(
        self, q: FloatArray, v: FloatArray, tau: FloatArray, out: FloatArray
    ) -> None:
        """Set `out` to q'' = M^-1 (tau - C q' - G) [rad/s^2], all (runs, n)."""
        self._accelerations(
            self._alive, self.model, self.bodies, self.gravity, self.frames, q, v, tau, self.mass,
            out,
        )  # fmt: skip
