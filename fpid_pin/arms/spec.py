"""An arm as a plain table: joints one behind the other, what each carries, frames and shapes."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.inertia import inertia_of, require_physical
from fpid_pin.arms.joints import UNITS, Numbers, joint_model, placement_of
from fpid_pin.arms.shapes import SIZES, Shape
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, shown

T = TypeVar("T")
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
#: Fields that hold several numbers, and how many; None: as the kind of shape has it.
_SHAPES = {"axis": (3,), "placement": (3, 4), "inertia": (10,), "colour": (4,), "size": None}
_NEVER_NEGATIVE = ("effort", "velocity", "damping", "friction", "armature")


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

    name: str
    kind: str
    axis: Numbers
    placement: tuple[Numbers, ...]
    inertia: Numbers
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    velocity: float = math.inf
    damping: float = 0.0
    friction: float = 0.0
    armature: float = 0.0


@dataclass(frozen=True)
class Frame:
    """A frame by name: on the joint of this index (-1: the base), of a type in `FRAMES`."""

    name: str
    joint: int
    type: str
    placement: tuple[Numbers, ...]


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
    name: str = "arm"
    gravity: Numbers = (0.0, 0.0, -9.81)
    home: Numbers | None = None
    tool: str | None = None
    inertia: str = "error"
    credit: str = field(default="", compare=False)

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
        fields["gravity"] = tuple(gravity_vector(fields.get("gravity", 9.81)).tolist())
        if fields.get("home") is not None:
            fields["home"] = _plain(checks.vector("home", fields["home"], len(fields["joints"])))
        for key in ("name", "tool", "credit"):
            if fields.get(key) is not None:
                checks.instance(key, fields[key], str, "a text")
        spec = cls(**fields)
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
        for k, joint in enumerate(self.joints):
            _require_joint(joint, f"joints.{k}")
        taken = set[str]()
        for name in (
            *(joint.name for joint in self.joints),
            *(frame.name for frame in self.frames),
        ):
            if name in taken or not name:
                raise ArgumentError("name", "names of their own", f"{shown(name)} again")
            taken.add(name)
        for k, frame in enumerate(self.frames):
            _require_place(frame, f"frames.{k}", n)
            checks.choice(f"frames.{k}.type", frame.type, FRAMES)
        for k, shape in enumerate(self.shapes):
            _require_place(shape, f"shapes.{k}", n)
            kind = checks.choice(f"shapes.{k}.kind", shape.kind, SIZES)
            _shaped(f"shapes.{k}.size", shape.size, (SIZES[kind],))
        if self.tool is not None:
            checks.choice("tool", self.tool, [*taken])
        checks.choice("inertia", self.inertia, INERTIA)
        if self.inertia != "accept":
            names = [joint.name for joint in self.joints]
            require_physical(names, self.column("inertia"), cut(self.name))


def _require_joint(joint: Joint, where: str) -> None:
    checks.choice(f"{where}.kind", joint.kind, UNITS)
    axis = _shaped(f"{where}.axis", joint.axis, (3,))
    if not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
        raise ArgumentError(f"{where}.axis", "a unit vector", axis.tolist())
    _require_placement(joint.placement, f"{where}.placement")
    _shaped(f"{where}.inertia", joint.inertia, (10,))
    for key in _NEVER_NEGATIVE:
        finite = key not in ("effort", "velocity")
        checks.number(f"{where}.{key}", getattr(joint, key), low=0.0, finite=finite)
    if not joint.lower < joint.upper:
        raise ArgumentError(f"{where}.upper", f"a number > {joint.lower:g}", f"{joint.upper:g}")


def _require_place(item: Frame | Shape, where: str, n: int) -> None:
    checks.integer(f"{where}.joint", item.joint, low=-1, high=n - 1)
    _require_placement(item.placement, f"{where}.placement")


def _require_placement(rows: Any, where: str) -> None:
    rotation = _shaped(where, rows, (3, 4))[:, :3]
    near = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    if not near or np.linalg.det(rotation) < 0.0:
        raise ArgumentError(where, "a rotation in its first three columns", rotation.tolist())


def _shaped(where: str, value: Any, shape: tuple[int, ...] | None) -> FloatArray:
    """Return finite numbers of one shape; else one line that names them."""
    array = checks.floats(where, value)
    if shape is not None and array.shape != shape:
        raise ArgumentError(where, f"shape {shape}", f"shape {array.shape}")
    return array


def _item(cls: type[T], row: Any, where: str) -> T:
    """Build a joint, frame or shape from its table."""
    if not isinstance(row, Mapping):
        raise ArgumentError(where, "a table", shown(row))
    known = {item.name: item for item in dataclasses.fields(cls)}  # type: ignore[arg-type]
    for key in row:
        checks.choice(f"key in {where}", key, known)
    values: dict[str, Any] = {}
    for key, item in known.items():
        if key not in row:
            if item.default is dataclasses.MISSING:
                raise ArgumentError(f"{where}.{key}", "a value", "none")
        elif key in _SHAPES:
            values[key] = _plain(_shaped(f"{where}.{key}", row[key], _SHAPES[key]))
        elif item.type == "int":
            values[key] = checks.integer(f"{where}.{key}", row[key])
        elif item.type == "float":
            values[key] = checks.number(f"{where}.{key}", row[key], finite=False)
        else:
            checks.instance(f"{where}.{key}", row[key], str, "a text")
            values[key] = row[key]
    return cls(**values)


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
    return tuple(map(_plain, values)) if isinstance(values, list) else values


def gravity_vector(gravity: ArrayLike) -> FloatArray:
    """Return gravity as a (3,) vector in the world frame [m/s^2]; a number points down (-z)."""
    value = checks.floats("gravity", gravity)
    if value.ndim == 0:
        return checks.read_only((0.0, 0.0, -checks.number("gravity", gravity, low=0.0)))
    if value.shape != (3,):
        raise ArgumentError("gravity", "a number or shape (3,)", f"shape {value.shape}")
    return value
