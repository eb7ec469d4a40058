"""An arm as a plain table, joints one behind the other, and as the Pinocchio model of that table.

A reader's tree, a file and a planar arm's lengths all become a `Chain`, which checks them; what an
`Arm` keeps is the model, and its table is read from the model again.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import parts
from fpid_pin.checks import Array, Check, FloatArray, Number, OneOf, Text, Whole
from fpid_pin.descriptions import Description, without_defaults
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, shown

#: Of a frame: Pinocchio's types, by the name that tables have for them.
FRAMES = {
    "link": pin.FrameType.BODY,
    "fixed": pin.FrameType.FIXED_JOINT,
    "frame": pin.FrameType.OP_FRAME,
}
#: Numbers of a joint, and the vector of a Pinocchio model that has each.
VECTORS = {
    "lower": "lowerPositionLimit", "upper": "upperPositionLimit", "effort": "upperEffortLimit",
    "velocity": "upperVelocityLimit", "damping": "damping", "friction": "upperDryFrictionLimit",
    "armature": "armature",
}  # fmt: skip
#: Pinocchio's tables grow with the cube of the joints: 0.6 GB for 200.
MOST_JOINTS = 200
#: What to do with an inertia that no body has.
INERTIA = ("error", "nearest", "accept")
Row = dict[str, Any]


def _unit_vector(name: str, value: Any) -> FloatArray:
    axis = checks.floats(name, value, shape=(3,))
    # Large numbers first: their squares would overflow.
    if np.abs(axis).max() > 2.0 or not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
        raise ArgumentError(name, "a unit vector", axis.tolist())
    return axis


def gravity_vector(name: str, gravity: ArrayLike) -> FloatArray:
    """Return gravity as a (3,) vector in the world frame [m/s^2]; a number points down (-z)."""
    value = checks.floats(name, gravity)
    if value.ndim == 0:
        return checks.read_only((0.0, 0.0, -checks.number(name, gravity, low=0.0)))
    if value.shape != (3,):
        raise ArgumentError(name, "a number or shape (3,)", f"shape {value.shape}")
    return value


@dataclass(frozen=True, eq=False)
class Joint(Description):
    """A joint and what it carries; of a prismatic one m and N stand for rad and N m."""

    name: Annotated[str, Text]
    kind: Annotated[str, OneOf(*parts.UNITS)]
    #: Unit vector in the joint's own frame, which it turns about or slides along, (3,).
    axis: Annotated[ArrayLike, Check(_unit_vector)]
    #: The joint's frame in that of the joint before, as rows: a rotation, and where [m], (3, 4).
    placement: parts.Placement
    #: Of all that it carries: mass [kg], centre of mass [m], rotational inertia about the centre of
    #: mass [kg m^2] xx, xy, yy, xz, yz, zz.
    inertia: Annotated[ArrayLike, Array(shape=(10,))]
    lower: Annotated[float, Number("rad", finite=False)] = -math.inf
    upper: Annotated[float, Number("rad", finite=False)] = math.inf
    effort: Annotated[float, Number("N m", low=0.0, finite=False)] = math.inf
    velocity: Annotated[float, Number("rad/s", low=0.0, finite=False)] = math.inf
    damping: Annotated[float, Number("N m s/rad", low=0.0)] = 0.0  # viscous
    friction: Annotated[float, Number("N m", low=0.0)] = 0.0  # dry
    armature: Annotated[float, Number("kg m^2", low=0.0)] = 0.0  # rotor inertia at the joint

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.lower < self.upper:
            raise ArgumentError("upper", f"a number > {self.lower:g}", f"{self.upper:g}")


@dataclass(frozen=True, eq=False)
class Frame(Description):
    """A frame by name: on the joint of this index (-1: the base), of a type in `FRAMES`."""

    name: Annotated[str, Text]
    joint: Annotated[int, Whole(low=-1)]
    type: Annotated[str, OneOf(*FRAMES)]
    placement: parts.Placement


@dataclass(frozen=True, eq=False)
class Chain(Description):
    """A serial chain, written out: a table of kind ``model``, whatever it was read from."""

    joints: Sequence[Joint]  # from the base on
    frames: Sequence[Frame] = ()
    shapes: Sequence[parts.Shape] = ()  # what is drawn
    name: Annotated[str, Text] = "arm"
    gravity: Annotated[ArrayLike, Check(gravity_vector, "m/s^2")] = 9.81  # along -z, or (3,)
    home: Annotated[ArrayLike | None, Array("rad", max_ndim=1)] = None  # the middle of the limits
    tool: Annotated[str | None, Text] = None  # a frame; None: the last link of the last joint
    inertia: Annotated[str, OneOf(*INERTIA)] = "error"  # "accept": what no body has is let pass
    credit: Annotated[str, Text] = ""  # origin and licence

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.joints)
        if not 1 <= n <= MOST_JOINTS:
            raise ArgumentError("joints", f"from 1 to {MOST_JOINTS} joints", f"{n}")
        for group in ("frames", "shapes"):
            for k, item in enumerate(getattr(self, group)):
                checks.integer(f"{group}.{k}.joint", item.joint, low=-1, high=n - 1)
        if self.home is not None:
            checks.vector("home", self.home, n)
        names = [joint.name for joint in self.joints] + [frame.name for frame in self.frames]
        for k, name in enumerate(names):
            if name in names[:k] or not name:
                raise ArgumentError("name", "names of their own", f"{shown(name)} again")
        if self.tool is not None:
            checks.choice("tool", self.tool, names)
        if self.inertia != "accept":
            rows = np.array([joint.inertia for joint in self.joints])
            parts.require_physical(names[:n], rows, cut(self.name))

    @property
    def tool_frame(self) -> str:
        """The tool's frame."""
        last = len(self.joints) - 1
        links = [f.name for f in self.frames if f.joint == last and f.type == "link"]
        return self.tool or (links or [self.joints[last].name])[-1]

    def model(self) -> Any:
        """Build the ``pinocchio.Model``, nq = nv = n; home is its reference configuration."""
        model = pin.Model()
        model.name, model.gravity.linear = self.name, np.array(self.gravity)
        for k, joint in enumerate(self.joints):
            kind = parts.joint_model(joint.kind, np.array(joint.axis))
            at = model.addJoint(k, kind, parts.placement_of(joint.placement), joint.name)
            model.addJointFrame(at)
        for frame in self.frames:
            at, place = frame.joint + 1, parts.placement_of(frame.placement)
            # No inertia of its own: the joints' are whole.
            model.addFrame(pin.Frame(frame.name, at, place, FRAMES[frame.type]), False)
        columns = {key: [getattr(joint, key) for joint in self.joints] for key in VECTORS}
        set_columns(model, inertia=[joint.inertia for joint in self.joints], **columns)
        if self.home is not None:
            model.referenceConfigurations["home"] = np.array(self.home)
        return model


def column(model: Any, key: str) -> FloatArray:
    """Return a field of `Joint` of all joints of a model, (n,) or (n, 10)."""
    if key == "inertia":
        return np.array([parts.row_of(body) for body in list(model.inertias)[1:]])
    return np.array(getattr(model, VECTORS[key]), dtype=np.float64)


def set_columns(model: Any, **columns: Any) -> None:
    """Write fields of all joints, each (n,) or (n, 10), into a model."""
    for key, values in columns.items():
        if key == "inertia":
            for k, row in enumerate(values, start=1):
                # Set, not appended: appending adds to a zero inertia and rounds.
                model.inertias[k] = parts.inertia_of(row)
            continue
        name, numbers = VECTORS[key], np.array(values, dtype=np.float64)
        setattr(model, name, numbers)
        if name.startswith("upper") and key != "upper":
            setattr(model, name.replace("upper", "lower"), -numbers)


def joint_row(model: Any, k: int) -> Row:
    """Return joint `k` of a model as the table of a `Joint`; of one of no kind, what there is."""
    joint = model.joints[k]
    row: Row = {"name": str(model.names[k]), "kind": parts.kind_of(joint),
                "placement": parts.rows_of(model.jointPlacements[k])}  # fmt: skip
    if row["kind"] not in parts.UNITS:
        return row
    row |= {"axis": parts.axis_of(joint).tolist(), "inertia": parts.row_of(model.inertias[k])}
    for key, name in VECTORS.items():
        row[key] = float(getattr(model, name)[joint.idx_q if "Position" in name else joint.idx_v])
    # Of coordinates (cos, sin) there are no limits.
    return row if joint.nq == 1 else row | {"lower": -math.inf, "upper": math.inf}


def frame_rows(model: Any) -> list[Row]:
    """Return a model's frames as tables; a link that shares its name with a joint gets another."""
    taken, types = {str(name) for name in model.names}, {t: name for name, t in FRAMES.items()}
    return [
        {"name": own_name(str(frame.name), types[frame.type], taken),
         "joint": int(frame.parentJoint) - 1, "type": types[frame.type],
         "placement": parts.rows_of(frame.placement)}
        for frame in list(model.frames)[1:] if frame.type in types
    ]  # fmt: skip


def own_name(name: str, kind: str, taken: set[str]) -> str:
    """Return a name that none of `taken` has, and add it: Pinocchio cannot tell two apart."""
    while name in taken or not name:
        name = f"{name}_{kind}"
    taken.add(name)
    return name


def table_of(model: Any, shapes: Sequence[parts.Shape], **fields: Any) -> Row:
    """Return the table of the `Chain` that a model is; what is as by default is left out."""
    gravity = np.array(model.gravity.linear).tolist()
    down = gravity[:2] == [0, 0] and gravity[2] <= 0
    poses = {pair.key(): pair.data() for pair in model.referenceConfigurations}
    joints = [joint_row(model, k) for k in range(1, model.njoints)]
    fields |= {
        "joints": [without_defaults(Joint, row) for row in joints],
        "frames": frame_rows(model),
        "shapes": [without_defaults(parts.Shape, vars(shape)) for shape in shapes],
        "name": str(model.name),
        "home": poses.get("home"),
    }
    return without_defaults(Chain, fields) | {"gravity": -gravity[2] if down else gravity}
