"""The rigid-body terms of eq. (5), by Pinocchio, a call each; and the bodies that kernels move."""

import dataclasses
import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.chain import VECTORS, column
from fpid_pin.arms.parts import EFFORT_UNITS, UNITS, kind_of, link_of
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, html_table, named

#: Of an arm in a notebook.
_SHOWN = ("lower", "upper", "velocity_limit", "effort_limit", "viscous_friction", "dry_friction",
          "home")  # fmt: skip
#: Poses at which the mass matrix is tried, besides the arm's zero and home.
_POSES = 4
#: Smallest admissible ratio of the mass matrix's extreme eigenvalues (rounding alone gives 1e-16).
_SINGULAR = 1e-14
#: Of a symmetric matrix: xx, xy, xz, yy, yz, zz.
_UPPER = np.triu_indices(3)


def _column(key: str) -> cached_property[FloatArray]:
    def read(arm: "RigidBody") -> FloatArray:
        return checks.read_only(column(arm.model, key))

    return cached_property(read)


@dataclass(frozen=True, eq=False, repr=False)
class RigidBody:
    """The terms of (5): vectors of joints are (n,) and checked, results are fresh arrays."""

    model: Any
    tool: str

    def __getstate__(self) -> dict[str, Any]:
        # Without what is derived from them and kept.
        return {field.name: getattr(self, field.name) for field in dataclasses.fields(self)}

    @property
    def n(self) -> int:
        """Number of joints."""
        return int(self.model.nv)

    @cached_property
    def name(self) -> str:
        """Name of the robot."""
        return str(self.model.name)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in the order of every (n,) array."""
        return tuple(str(name) for name in list(self.model.names)[1:])

    # Numbers of the joints, (n,): see `Arm`.
    (
        lower, upper, effort_limit, velocity_limit, viscous_friction, dry_friction, armature,
    ) = map(_column, VECTORS)  # fmt: skip

    @cached_property
    def home(self) -> FloatArray:
        """A pose within the limits, (n,)."""
        bounded = np.isfinite(self.lower) & np.isfinite(self.upper)
        middle = np.zeros(self.n)
        middle[bounded] = 0.5 * (self.lower[bounded] + self.upper[bounded])
        # With one bound only, the admissible value nearest to 0.
        middle = np.clip(middle, self.lower, self.upper)
        poses = {pair.key(): pair.data() for pair in self.model.referenceConfigurations}
        home = np.array(poses.get("home", middle))
        return checks.read_only(np.where((home >= self.lower) & (home <= self.upper), home, middle))

    @cached_property
    def joint_kinds(self) -> tuple[str, ...]:
        """``"revolute"`` or ``"prismatic"``, by joint."""
        return tuple(kind_of(joint) for joint in list(self.model.joints)[1:])

    @property
    def units(self) -> tuple[str, ...]:
        """``"rad"`` or ``"m"``, by joint: the unit of its coordinate."""
        return tuple(UNITS[kind] for kind in self.joint_kinds)

    @property
    def effort_units(self) -> tuple[str, ...]:
        """``"N m"`` or ``"N"``, by joint."""
        return tuple(EFFORT_UNITS[kind] for kind in self.joint_kinds)

    @property
    def gravity(self) -> float:
        """Magnitude of gravity [m/s^2]; its direction is ``model.gravity.linear``."""
        return math.hypot(*self.model.gravity.linear)

    def mass_matrix(self, q: ArrayLike) -> FloatArray:
        """Return M(q) [kg m^2], (n, n): symmetric, rotor inertia included."""
        upper = np.triu(self._call(pin.crba, q=q))
        return np.asarray(upper + np.triu(upper, 1).T)

    def coriolis_matrix(self, q: ArrayLike, v: ArrayLike) -> FloatArray:
        """Return C(q, q'), (n, n), in Christoffel's form: M' - 2 C is skew.

        The paper's C in eq. (35) is another matrix with the same C q'.
        """
        return self._call(pin.computeCoriolisMatrix, q=q, v=v)

    def gravity_vector(self, q: ArrayLike) -> FloatArray:
        """Return G(q) [N m], (n,)."""
        return self._call(pin.computeGeneralizedGravity, q=q)

    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, a: ArrayLike) -> FloatArray:
        """Return tau = M q'' + C q' + G [N m], (n,) (recursive Newton-Euler)."""
        return self._call(pin.rnea, q=q, v=v, a=a)

    def forward_dynamics(self, q: ArrayLike, v: ArrayLike, tau: ArrayLike) -> FloatArray:
        """Return q'' = M^-1 (tau - C q' - G) [rad/s^2], (n,) (articulated bodies)."""
        return self._call(pin.aba, pin.Convention.WORLD, q=q, v=v, tau=tau)

    def tool_pose(self, q: ArrayLike) -> FloatArray:
        """Return the tool frame's pose in the world, a (4, 4) homogeneous matrix [m]."""
        self._call(pin.forwardKinematics, q=q)
        pose = pin.updateFramePlacement(self.model, self._data, self.model.getFrameId(self.tool))
        return np.array(pose.homogeneous)

    def tool_jacobian(self, q: ArrayLike) -> FloatArray:
        """Return J, (6, n): the tool's linear then angular velocity in world axes is J q'."""
        frame = self.model.getFrameId(self.tool)
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        return self._call(pin.computeFrameJacobian, frame, axes, q=q).reshape(6, self.n)

    def joint_index(self, joint: str | int) -> int:
        """Return the index of a joint given by name, or by index, which is checked."""
        if isinstance(joint, str):
            return self.joint_names.index(checks.choice("joint", joint, self.joint_names))
        return checks.integer("joint", joint, low=0, high=self.n - 1)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, RigidBody):
            return NotImplemented
        return bool(self.tool == other.tool and self.model == other.model)

    def __hash__(self) -> int:
        return hash((self.name, self.joint_names))

    def _repr_html_(self) -> str:
        columns = [getattr(self, name).tolist() for name in _SHOWN]
        units = [", ".join(pair) for pair in zip(self.units, self.effort_units, strict=True)]
        heads = ("joint", "in (rates per s)", *(name.replace("_", " ") for name in _SHOWN))
        rows = zip(self.joint_names, units, *columns, strict=True)
        return html_table(f"{self.name}: {self.n} joints, tool {self.tool}", heads, rows)

    @cached_property
    def bodies(self) -> Any:
        """What the kernels move, (n,) BODY of `kernels.records`; not to be written."""
        bodies = bodies_of(self.model)
        bodies.flags.writeable = False
        return bodies

    @cached_property
    def _data(self) -> Any:
        return self.model.createData()

    def _call(self, function: Callable[..., Any], *more: Any, **given: ArrayLike) -> FloatArray:
        """Return what an algorithm of Pinocchio makes of these (n,) vectors, and of more."""
        vectors = (checks.vector(name, value, self.n) for name, value in given.items())
        return np.array(function(self.model, self._data, *vectors, *more))

    def _require_regular(self) -> None:
        """Refuse a massless link that leaves the mass matrix singular.

        Tried at the zero pose, at home and at a few seeded poses: a massless elbow, say, is regular
        while the arm is bent and singular when it is straight.
        """
        random = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSES, self.n))
        for q in np.vstack((np.zeros(self.n), self.home, random)):
            mass = self.mass_matrix(q)
            if not np.isfinite(mass).all():
                raise ArmError(
                    f"{cut(self.name)}: expected finite inertias, got a mass matrix with NaN or inf"
                )
            values, vectors = np.linalg.eigh(mass)
            if values[0] > _SINGULAR * max(values[-1], np.finfo(np.float64).tiny):
                continue
            # The direction in which nothing moves: the culprit is a massless link that takes part
            # in it, or else the link that moves most.
            share = np.abs(vectors[:, 0])
            bodies = list(self.model.inertias)[1:]
            idle = [k for k, body in enumerate(bodies) if body.mass <= 0.0 and share[k] > 1e-6]
            k = (idle or [int(np.argmax(share))])[0]
            none = sum(body.mass <= 0.0 for body in bodies)
            raise ArmError(
                f"{cut(self.name)}: expected a positive definite mass matrix, got smallest "
                f"eigenvalue {values[0]:.3g}: link {named(link_of(self.model, k + 1))} (moved by "
                f"joint {named(self.joint_names[k])}) has too little mass or inertia (links "
                f"without mass: {none} of {self.n}; the robot's file has to give it)"
            )


# ---------------------------------------------------------------------- for the kernels


def bodies_of(model: Any) -> Any:
    """Return the bodies of a Pinocchio model of revolute and prismatic joints, (n,) BODY.

    Each body's frame is turned so that its joint's axis is z; angles, and everything that has one
    number a joint, stay.
    """
    # It loads numba.
    from fpid_pin.kernels.records import BODY

    bodies = np.zeros(model.nv, BODY)
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


def inertial_numbers(bodies: Any) -> FloatArray:
    """Return the ten inertial numbers of each body, (n, 10): m, h (3), and j (6)."""
    names = ["m", "h0", "h1", "h2", "j00", "j01", "j02", "j11", "j12", "j22"]
    return np.stack([bodies[name] for name in names], axis=1)
