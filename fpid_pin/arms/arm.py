"""The arm: a fixed-base chain of joints on Pinocchio, with the terms of eq. (5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from fpid_pin import checks
from fpid_pin.arms.changes import ArmChanges
from fpid_pin.arms.constructors import ArmConstructors
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
class Arm(RigidBody, ArmConstructors, ArmChanges):
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
    _changes: tuple[Mapping[str, Any], ...] = ()

    # ------------------------------------------------------------------ what it is

    @property
    def credit(self) -> str:
        """Origin and licence of the arm's description, where known."""
        return self._spec.credit

    def __repr__(self) -> str:
        changes = "".join(f" + {name}" for change in self._changes for name in change)
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
        table = dict(self._origin)
        return table | {"changes": list(self._changes)} if self._changes else table

    @classmethod
    def _assembled(cls, spec: ArmSpec, origin: Mapping[str, Any] | None = None) -> Self:
        model = spec.model()
        require_regular(model, spec.name, spec.pose)
        return cls._of(spec, model, origin, ())

    def _changed(self, spec: ArmSpec, change: Mapping[str, Any]) -> Self:
        model = self.model.copy()
        spec.fill(model)
        return self._of(spec, model, self._origin, (*self._changes, change))

    @classmethod
    def _of(
        cls,
        spec: ArmSpec,
        model: Any,
        origin: Mapping[str, Any] | None,
        changes: tuple[Mapping[str, Any], ...],
    ) -> Self:
        columns: dict[str, Any] = {
            name: checks.read_only(spec.column(key)) for name, key in _COLUMNS.items()
        }
        return cls(
            model, spec.name, tuple(joint.name for joint in spec.joints), spec.tool_frame,
            **columns, home=checks.read_only(spec.pose), _spec=spec, _origin=origin,
            _changes=changes,
        )  # fmt: skip
