"""An arm as a plain table: joints one behind the other, what each carries, frames and shapes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, TypeVar, cast

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.inertia import inertia_of, require_physical
from fpid_pin.arms.joints import UNITS, Numbers, joint_model, placement_of
from fpid_pin.checks import Array, Check, FloatArray, Number, OneOf, Text, Whole
from fpid_pin.descriptions import keys
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, shown

T = TypeVar("T")
#: How many numbers the size of a shape has, by kind [m]; of a mesh it is the scale.
SIZES = {
    "box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "cone": 2, "ellipsoid": 3, "mesh": 3
}  # fmt: skip
#: Pinocchio's own, where no colour is given.
GREY = (0.9, 0.9, 0.9, 1.0)
#: Of a frame: Pinocchio's types, by the name that tables have for them.
FRAMES = {
    "link": pin.FrameType.BODY,
    "fixed": pin.FrameType.FIXED_JOINT,
    "frame": pin.FrameType.OP_FRAME,
}
#: Pinocchio's tables grow with the cube of the joints: 0.6 GB for 200.
MOST_JOINTS = 200
#: What to do with an inertia that no body has.
INERTIA = ("error", "nearest", "accept")


def _unit_vector(name: str, value: Any) -> FloatArray:
    axis = checks.floats(name, value, shape=(3,))
    # Large numbers first: their squares would overflow.
    if np.abs(axis).max() > 2.0 or not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
        raise ArgumentError(name, "a unit vector", axis.tolist())
    return axis


def _placement(name: str, value: Any) -> FloatArray:
    rows = checks.floats(name, value, shape=(3, 4))
    rotation = rows[:, :3]
    small = np.abs(rotation).max() < 2.0
    near = small and np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    if not near or np.linalg.det(rotation) < 0.0:
        raise ArgumentError(name, "a rotation in its first three columns", rotation.tolist())
    return rows


Placement = Annotated[tuple[Numbers, ...], Check(_placement, "m")]


@dataclass(frozen=True)
class Joint:
    """A joint and what it carries; of a prismatic one m and N stand for rad and N m.

    Attributes
    ----------
    name : str
    kind : str
        ``"revolute"`` or ``"prismatic"``.
    axis : tuple, (3,)
        Unit vector in the joint's own frame, which it turns about or slides along.
    placement : tuple, (3, 4)
        The joint's frame in that of the joint before, as rows: a rotation, and where [m].
    inertia : tuple, (10,)
        Of all that it carries: mass [kg], centre of mass [m], rotational inertia about the centre
        of mass [kg m^2] xx, xy, yy, xz, yz, zz.
    lower, upper : float
        Position limits [rad].
    effort, velocity : float
        Limits [N m], [rad/s].
    damping, friction, armature : float
        Viscous [N m s/rad] and dry friction [N m], rotor inertia at the joint [kg m^2].
    """

    name: Annotated[str, Text]
    kind: Annotated[str, OneOf(*UNITS)]
    axis: Annotated[Numbers, Check(_unit_vector)]
    placement: Placement
    inertia: Annotated[Numbers, Array(shape=(10,))]
    lower: Annotated[float, Number("rad", finite=False)] = -math.inf
    upper: Annotated[float, Number("rad", finite=False)] = math.inf
    effort: Annotated[float, Number("N m", low=0.0, finite=False)] = math.inf
    velocity: Annotated[float, Number("rad/s", low=0.0, finite=False)] = math.inf
    damping: Annotated[float, Number("N m s/rad", low=0.0)] = 0.0
    friction: Annotated[float, Number("N m", low=0.0)] = 0.0
    armature: Annotated[float, Number("kg m^2", low=0.0)] = 0.0


@dataclass(frozen=True)
class Frame:
    """A frame by name: on the joint of this index (-1: the base), of a type in `FRAMES`."""

    name: Annotated[str, Text]
    joint: Annotated[int, Whole(low=-1)]
    type: Annotated[str, OneOf(*FRAMES)]
    placement: Placement


@dataclass(frozen=True)
class Shape:
    """A solid or a mesh on the joint of this index (-1: the base); colours are within [0, 1]."""

    joint: Annotated[int, Whole(low=-1)]
    placement: Placement
    kind: Annotated[str, OneOf(*SIZES)]
    size: Annotated[Numbers, Array("m", max_ndim=1)]
    colour: Annotated[Numbers, Array(shape=(4,))] = GREY
    path: Annotated[str, Text] = ""


@dataclass(frozen=True)
class ArmSpec:
    """A serial chain, written out. It needs no parser, whatever it was read with.

    Attributes
    ----------
    joints : tuple of Joint
        From the base on.
    frames : tuple of Frame
    shapes : tuple of Shape
        What is drawn.
    name : str
    gravity : tuple, (3,)
        In the world's frame [m/s^2].
    home : tuple, (n,), or None
        None: the middle of the limits.
    tool : str or None
        A frame; None: the last link of the last joint.
    inertia : str
        ``"accept"``: inertias that no body has are let pass.
    credit : str
        Origin and licence.
    """

    joints: tuple[Joint, ...]
    frames: tuple[Frame, ...] = ()
    shapes: tuple[Shape, ...] = field(default=(), compare=False)
    name: Annotated[str, Text] = "arm"
    gravity: Annotated[Numbers, Array("m/s^2", shape=(3,))] = (0.0, 0.0, -9.81)
    home: Annotated[Numbers | None, Array("rad", max_ndim=1)] = None
    tool: Annotated[str | None, Text] = None
    inertia: Annotated[str, OneOf(*INERTIA)] = "error"
    credit: Annotated[str, Text] = field(default="", compare=False)

    # ------------------------------------------------------------------ columns

    def column(self, key: str) -> FloatArray:
        """Return a field of all joints, (n,) or (n, 10)."""
        return np.array([getattr(joint, key) for joint in self.joints], dtype=np.float64)

    def with_columns(self, **columns: Any) -> ArmSpec:
        """Return the arm with other numbers in fields of its joints, each (n,) or (n, 10)."""
        rows = zip(*(_plain(np.asarray(values)) for values in columns.values()), strict=True)
        joints = [
            dataclasses.replace(joint, **dict(zip(columns, row, strict=True)))
            for joint, row in zip(self.joints, rows, strict=True)
        ]
        return dataclasses.replace(self, joints=tuple(joints))

    @property
    def pose(self) -> FloatArray:
        """Home, (n,), each joint within its limits; else the admissible value nearest to middle."""
        lower, upper = self.column("lower"), self.column("upper")
        bounded = np.isfinite(lower) & np.isfinite(upper)
        middle = np.zeros(len(self.joints))
        middle[bounded] = 0.5 * (lower[bounded] + upper[bounded])
        # With one bound only, the admissible value nearest to 0.
        middle = np.clip(middle, lower, upper)
        home = middle if self.home is None else np.array(self.home)
        return np.where((home >= lower) & (home <= upper), home, middle)

    @property
    def tool_frame(self) -> str:
        """The tool's frame."""
        last = len(self.joints) - 1
        links = [f.name for f in self.frames if f.joint == last and f.type == "link"]
        return self.tool or (links or [self.joints[last].name])[-1]

    # ------------------------------------------------------------------ Pinocchio's model

    def model(self) -> Any:
        """Build the ``pinocchio.Model``, nq = nv = n."""
        model = pin.Model()
        model.name = self.name
        for k, joint in enumerate(self.joints):
            kind = joint_model(joint.kind, np.array(joint.axis))
            at = model.addJoint(k, kind, placement_of(joint.placement), joint.name)
            model.addJointFrame(at)
        for frame in self.frames:
            at, place = frame.joint + 1, placement_of(frame.placement)
            # No inertia of its own: the joints' are whole.
            model.addFrame(pin.Frame(frame.name, at, place, FRAMES[frame.type]), False)
        self.fill(model)
        return model

    def fill(self, model: Any) -> None:
        """Write inertias, limits, friction and gravity into a model of these joints."""
        for k, joint in enumerate(self.joints, start=1):
            # Set, not appended: appending adds to a zero inertia and rounds.
            model.inertias[k] = inertia_of(joint.inertia)
        model.gravity.linear = np.array(self.gravity)
        model.armature = self.column("armature")
        model.damping = self.column("damping")
        model.lowerPositionLimit, model.upperPositionLimit = map(self.column, ("lower", "upper"))
        for key, name in (("effort", "Effort"), ("velocity", "Velocity"),
                          ("friction", "DryFriction")):  # fmt: skip
            setattr(model, f"lower{name}Limit", -self.column(key))
            setattr(model, f"upper{name}Limit", self.column(key))

    # ------------------------------------------------------------------ as a table of a file

    def table(self) -> dict[str, Any]:
        """Return the plain table; what is as it is by default is left out."""
        table = _row(self)
        gravity = self.gravity
        table["gravity"] = -gravity[2] if gravity[:2] == (0, 0) and gravity[2] <= 0 else [*gravity]
        return table

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> ArmSpec:
        """Read what `table` returned, perhaps by way of a file.

        Raises
        ------
        ArgumentError, ArmError
            Naming the key at fault.
        """
        fields = dict(table)
        for key, kind in (("joints", Joint), ("frames", Frame), ("shapes", Shape)):
            rows = fields.get(key, ())
            checks.instance(key, rows, (list, tuple), "a list of tables")
            fields[key] = tuple(_item(kind, row, f"{key}.{k}") for k, row in enumerate(rows))
        fields["gravity"] = gravity_vector(fields.get("gravity", 9.81))
        spec = cls(**{key: _plain(value) for key, value in fields.items()})
        spec.require_sound()
        return spec

    def require_sound(self) -> None:
        """Refuse, by the key at fault, numbers and names that no arm has.

        Raises
        ------
        ArgumentError, ArmError
        """
        n = len(self.joints)
        if not 1 <= n <= MOST_JOINTS:
            raise ArgumentError("joints", f"from 1 to {MOST_JOINTS} joints", f"{n}")
        _check(self, "")
        for group in ("joints", "frames", "shapes"):
            for k, item in enumerate(getattr(self, group)):
                _check(item, f"{group}.{k}.")
                checks.integer(f"{group}.{k}.joint", getattr(item, "joint", 0), low=-1, high=n - 1)
        for k, joint in enumerate(self.joints):
            if not joint.lower < joint.upper:
                expected = f"a number > {joint.lower:g}"
                raise ArgumentError(f"joints.{k}.upper", expected, f"{joint.upper:g}")
        for k, shape in enumerate(self.shapes):
            checks.floats(f"shapes.{k}.size", shape.size, shape=(SIZES[shape.kind],))
        if self.home is not None:
            checks.vector("home", self.home, n)
        taken = set[str]()
        for name in [joint.name for joint in self.joints] + [frame.name for frame in self.frames]:
            if name in taken or not name:
                raise ArgumentError("name", "names of their own", f"{shown(name)} again")
            taken.add(name)
        if self.tool is not None:
            checks.choice("tool", self.tool, [*taken])
        if self.inertia != "accept":
            names = [joint.name for joint in self.joints]
            require_physical(names, self.column("inertia"), cut(self.name))


def _check(item: Any, where: str) -> None:
    for key in keys(cast("Any", type(item))).values():
        key.checked(where + key.name, getattr(item, key.name))


def _item(cls: type[T], row: Any, where: str) -> T:
    """Build a joint, frame or shape from its table."""
    if not isinstance(row, Mapping):
        raise ArgumentError(where, "a table", shown(row))
    known = keys(cast("Any", cls))
    for name in row:
        checks.choice(f"{where}.{name}", name, known)
    for name, key in known.items():
        if key.required and name not in row:
            raise ArgumentError(f"{where}.{name}", "a value", "none")
    # What the values are is checked with all else.
    return cls(**{name: _plain(value) for name, value in row.items()})


def _row(item: Any) -> dict[str, Any]:
    """Return the fields of a dataclass that are not as they are by default, as plain values."""
    values = {f.name: getattr(item, f.name) for f in dataclasses.fields(item)
              if getattr(item, f.name) != f.default}  # fmt: skip
    return {key: _listed(value) for key, value in values.items()}


def _listed(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_listed(part) for part in value]
    return _row(value) if dataclasses.is_dataclass(value) else value


def _plain(array: Any) -> Any:
    """Return an array as numbers within tuples."""
    values = array.tolist() if isinstance(array, np.ndarray) else array
    return tuple(map(_plain, values)) if isinstance(values, (list, tuple)) else values


def gravity_vector(gravity: ArrayLike) -> FloatArray:
    """Return gravity as a (3,) vector in the world frame [m/s^2]; a number points down (-z)."""
    value = checks.floats("gravity", gravity)
    if value.ndim == 0:
        return checks.read_only((0.0, 0.0, -checks.number("gravity", gravity, low=0.0)))
    if value.shape != (3,):
        raise ArgumentError("gravity", "a number or shape (3,)", f"shape {value.shape}")
    return value
