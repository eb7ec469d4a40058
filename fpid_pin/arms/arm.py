"""The arm: a fixed-base chain of joints on Pinocchio, with the terms of eq. (5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import change
from fpid_pin.arms.constructors import ArmConstructors
from fpid_pin.arms.inertia import perturbed_rows
from fpid_pin.arms.rigid_body import RigidBody, require_regular
from fpid_pin.arms.shapes import geometry_of
from fpid_pin.arms.spec import ArmSpec
from fpid_pin.checks import FloatArray
from fpid_pin.text import cut

#: Fields of an arm that are one number a joint, and a joint's own name for each.
_COLUMNS = {
    "lower": "lower", "upper": "upper", "effort_limit": "effort", "velocity_limit": "velocity",
    "viscous_friction": "damping", "dry_friction": "friction",
}  # fmt: skip


@dataclass(frozen=True, eq=False, repr=False)
class Arm(RigidBody, ArmConstructors):
    """A robot arm with n revolute or prismatic joints; immutable and picklable.

    Made by `two_link`, `planar`, `from_file`, `from_model` and their kin (see `ArmConstructors`),
    and from other arms by `with_payload` and its kin. What is an angle [rad] or a torque [N m]
    below is a length [m] or a force [N] for a prismatic joint: see `units`. The rigid-body terms
    are those of

        M(q) q'' + C(q, q') q' + G(q) = tau                                             (5)

    without friction, which is kept beside them (`viscous_friction`, `dry_friction`).

    Attributes
    ----------
    name : str
    joint_names : tuple of str
        In the order of every (n,) array.
    lower, upper : ndarray, (n,)
        Position limits [rad]; -inf, inf where there are none.
    effort_limit, velocity_limit : ndarray, (n,)
        [N m] and [rad/s]; inf where none is given (a URDF's 0 means that too).
    viscous_friction, dry_friction : ndarray, (n,)
        F_v [N m s/rad] and F_d [N m].
    home : ndarray, (n,)
        A pose within the limits: the catalogue's, else the middle of the limits, else 0.
    tool : str
        The frame that `tool_pose` and `with_payload` mean.
    model : pinocchio.Model
        nq = nv = n. Treat it as read-only.
    """

    lower: FloatArray
    upper: FloatArray
    effort_limit: FloatArray
    velocity_limit: FloatArray
    viscous_friction: FloatArray
    dry_friction: FloatArray
    home: FloatArray
    _spec: ArmSpec
    _origin: Mapping[str, Any] | None = None
    _changes: tuple[change.Change, ...] = ()

    # ------------------------------------------------------------------ what it is

    @property
    def credit(self) -> str:
        """Origin and licence of the arm's description, where known."""
        return self._spec.credit

    def __repr__(self) -> str:
        changes = "".join(f" + {item.name}" for item in self._changes)
        return f"<Arm {self.name}{changes}, {self.n} joints>"

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, Arm):
            return NotImplemented
        return self._spec == other._spec

    def __hash__(self) -> int:
        return hash((self.name, self.joint_names))

    def joint_index(self, joint: str | int) -> int:
        """Return the index of a joint given by name (or by index, which is checked).

        Raises
        ------
        ArgumentError
            An unknown name (the message gives the nearest), or an index out of range.
        """
        if isinstance(joint, str):
            return self.joint_names.index(checks.choice("joint", joint, self.joint_names))
        return checks.integer("joint", joint, low=0, high=self.n - 1)

    # ------------------------------------------------------------------ other arms

    def with_payload(
        self,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        frame: str | None = None,
        inertia: ArrayLike | None = None,
    ) -> Arm:
        """Return the arm holding a body, `mass` [kg], at `com` [m] of `frame` (None: the tool's).

        `inertia` is the body's (3, 3) rotational inertia about its centre of mass; None: a point.
        """
        return self._changed(change.Payload(mass, com, frame, inertia))

    def with_friction(self, viscous: ArrayLike | None = None, dry: ArrayLike | None = None) -> Arm:
        """Return the arm with other F_v [N m s/rad] or F_d [N m]; what is None stays."""
        return self._changed(change.Friction(viscous, dry))

    def with_limits(
        self,
        effort: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Arm:
        """Return the arm with other limits; what is None stays.

        `effort` [N m] and `velocity` [rad/s]: 0 or inf is none; `lower` and `upper` [rad]: -inf or
        inf is none. Home moves into them.
        """
        return self._changed(change.Limits(effort, velocity, lower, upper))

    def with_gravity(self, gravity: ArrayLike) -> Arm:
        """Return the arm under another gravity [m/s^2]: a number (along -z) or (3,)."""
        return self._changed(change.Gravity(gravity))

    def with_armature(self, armature: ArrayLike) -> Arm:
        """Return the arm with other rotor inertias [kg m^2], seen at the joint."""
        return self._changed(change.Armature(armature))

    def with_scaled_links(self, mass: ArrayLike = 1.0, inertia: ArrayLike = 1.0) -> Arm:
        """Return the arm with heavier or lighter links, each by a factor > 0, a scalar or (n,).

        `mass` scales a link's density, and with it its rotational inertia, which `inertia` scales
        further. Centres of mass stay; what is made is physically consistent if this arm is.
        """
        return self._changed(change.ScaledLinks(mass, inertia))

    def with_changes(self, *changes: change.Change) -> Arm:
        """Return the arm with several changes of `fpid_pin.arms.change`, made at once, in order."""
        return self._changed(*changes)

    def perturbed(
        self,
        rng: np.random.Generator,
        mass: float = 0.2,
        com: float = 0.0,
        inertia: float = 0.0,
        friction: float = 0.0,
    ) -> Arm:
        """Return an arm whose true parameters differ from this one's, at random.

        Parameters
        ----------
        rng
            Where chance comes from; the same state gives the same arm.
        mass
            Relative spread of each link's mass (and of its rotational inertia with it), in [0, 1).
        com
            Each centre of mass moves by up to this much along each axis [m].
        inertia
            Further relative spread of the rotational inertia about the centre of mass, in [0, 1).
        friction
            Relative spread of F_v and F_d per joint, in [0, 1].

        Notes
        -----
        All spreads are uniform. Whatever is drawn is physically consistent if this arm is.
        """
        checks.instance("rng", rng, np.random.Generator, "a numpy.random.Generator")
        for name, value in (("mass", mass), ("inertia", inertia), ("friction", friction)):
            checks.number(name, value, low=0.0, high=1.0 if name == "friction" else 1.0 - 1e-9)
        checks.number("com", com, low=0.0)
        rows = perturbed_rows(self._spec.column("inertia"), rng, mass, com, inertia)
        arm = self._changed(change.Inertias(rows))
        if friction:
            scale = rng.uniform(1.0 - friction, 1.0 + friction, (2, self.n))
            viscous, dry = scale[0] * self.viscous_friction, scale[1] * self.dry_friction
            arm = arm.with_friction(viscous, dry)
        return arm

    def visual(self) -> tuple[Any, Any]:
        """Return (model, visual ``pinocchio.GeometryModel``) for a viewer, loaded on first use.

        Warns
        -----
        FpidWarning
            Once, when meshes are missing; the geometry is then incomplete.
        """
        if "visual" not in self._cache:
            self._cache["visual"] = geometry_of(self._spec.shapes, cut(self.name))
        return self.model, self._cache["visual"].copy()

    def to_dict(self) -> dict[str, Any]:
        """Return the table that `fpid_pin.descriptions.from_dict` rebuilds the arm from."""
        if self._origin is None:
            # Changes are in its numbers.
            return {"kind": "model", **self._spec.table()}
        changes = [item.table() for item in self._changes]
        return {**self._origin, "changes": changes} if changes else dict(self._origin)

    @classmethod
    def _assembled(cls, spec: ArmSpec, origin: Mapping[str, Any] | None = None) -> Self:
        model = spec.model()
        require_regular(model, spec.name, spec.pose)
        return cls._of(spec, model, origin, ())

    def _changed(self, *items: change.Change) -> Arm:
        spec, model = self._spec, self.model.copy()
        for item in items:
            spec = item.apply(spec)
        spec.fill(model)
        return self._of(spec, model, self._origin, (*self._changes, *items))

    @classmethod
    def _of(
        cls,
        spec: ArmSpec,
        model: Any,
        origin: Mapping[str, Any] | None,
        changes: tuple[change.Change, ...],
    ) -> Self:
        columns: dict[str, Any] = {
            name: checks.read_only(spec.column(key)) for name, key in _COLUMNS.items()
        }
        return cls(
            model, spec.name, tuple(joint.name for joint in spec.joints), spec.tool_frame,
            **columns, home=checks.read_only(spec.pose), _spec=spec, _origin=origin,
            _changes=changes,
        )  # fmt: skip
