"""What an arm is made of, as plain numbers and as Pinocchio's objects: joints, links, shapes."""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.checks import Array, Check, FloatArray, OneOf, Text, Whole
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError, ArmError, FpidWarning
from fpid_pin.text import cut, named, shown

Numbers = tuple[float, ...]
REVOLUTE, PRISMATIC = "revolute", "prismatic"
#: Of a coordinate, by the kind of its joint; an effort is [N m] or [N].
UNITS = {REVOLUTE: "rad", PRISMATIC: "m"}
EFFORT_UNITS = {REVOLUTE: "N m", PRISMATIC: "N"}
#: By the names of Pinocchio's classes; of the third four the coordinates are (cos, sin).
_KINDS = dict.fromkeys(
    ("RX", "RY", "RZ", "RevoluteUnaligned",
     "RUBX", "RUBY", "RUBZ", "RevoluteUnboundedUnaligned"), REVOLUTE
) | dict.fromkeys(("PX", "PY", "PZ", "PrismaticUnaligned"), PRISMATIC)  # fmt: skip


def kind_of(joint: Any) -> str:
    """Return the kind of one of a Pinocchio model's joints; of one that is neither, its class."""
    name = str(joint.shortname()).removeprefix("JointModel")
    return _KINDS.get(name, name)


def axis_of(joint: Any) -> FloatArray:
    """Return the axis that a joint turns about or slides along, in its own frame, (3,)."""
    data = joint.createData()
    joint.calc(data, np.eye(joint.nq)[0] if joint.nq > 1 else np.zeros(joint.nq))
    motion = np.array(data.S, dtype=np.float64).reshape(6)
    return motion[:3] if kind_of(joint) == PRISMATIC else motion[3:]


def joint_model(kind: str, axis: FloatArray) -> Any:
    """Return Pinocchio's joint of this kind about or along a unit vector, (3,)."""
    for name, unit in zip("XYZ", np.eye(3), strict=True):
        # Pinocchio has faster code for these.
        if np.array_equal(axis, unit):
            return getattr(pin, f"JointModel{'R' if kind == REVOLUTE else 'P'}{name}")()
    return getattr(pin, f"JointModel{kind.title()}Unaligned")(axis)


def displacement(kind: str, axis: FloatArray, value: float) -> Any:
    """Return where a joint takes its frame at a value [rad] or [m], a ``pinocchio.SE3``."""
    if kind == PRISMATIC:
        return pin.SE3(np.eye(3), value * axis)
    return pin.SE3(pin.AngleAxis(value, axis).matrix(), np.zeros(3))


def rows_of(placement: Any) -> tuple[Numbers, ...]:
    """Return a ``pinocchio.SE3`` as the upper three rows of its (4, 4) matrix."""
    return tuple(tuple(row) for row in np.asarray(placement.homogeneous)[:3].tolist())


def placement_of(rows: ArrayLike) -> Any:
    """Build a ``pinocchio.SE3`` from three rows of four numbers."""
    matrix = np.array(rows, dtype=np.float64)
    return pin.SE3(np.array(matrix[:, :3]), np.array(matrix[:, 3]))


def _placement(name: str, value: Any) -> FloatArray:
    rows = checks.floats(name, value, shape=(3, 4))
    rotation = rows[:, :3]
    small = np.abs(rotation).max() < 2.0
    near = small and np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    if not near or np.linalg.det(rotation) < 0.0:
        raise ArgumentError(name, "a rotation in its first three columns", rotation.tolist())
    return rows


Placement = Annotated[ArrayLike, Check(_placement, "m")]


def link_of(model: Any, joint: int) -> str:
    """Return the name of the link that `joint` moves."""
    for frame in model.frames:
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY:
            return str(frame.name)
    return str(model.names[joint])


# ---------------------------------------------------------------------- links: ten numbers each

#: Of a row: xx, xy, xz, xy, yy, ... of the symmetric matrix; and of that, what a row has.
_ENTRIES = [4, 5, 7, 5, 6, 8, 7, 8, 9]
SIX = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
#: Part of the largest principal moment by which the others may fall short: files are rounded, some
#: to three digits.
_ROUNDING = 1e-2
#: A radius of gyration that is nothing [m].
_NEGLIGIBLE = 1e-6


def inertia_of(row: Sequence[float] | FloatArray) -> Any:
    """Build a ``pinocchio.Inertia`` from its ten numbers (see `fpid_pin.arms.chain.Joint`)."""
    numbers = np.asarray(row, dtype=np.float64)
    inertia = pin.Inertia(float(numbers[0]), np.array(numbers[1:4]), np.eye(3))
    # Afterwards, and so without a check: what is asked for may be no body's.
    inertia.inertia = numbers[_ENTRIES].reshape(3, 3)
    return inertia


def row_of(inertia: Any) -> Numbers:
    """Return the ten numbers of a ``pinocchio.Inertia``."""
    about = np.array(inertia.inertia)[SIX].tolist()
    return (float(inertia.mass), *np.array(inertia.lever).tolist(), *about)


def moved(row: Sequence[float], place: Any) -> Numbers:
    """Return the row in another frame, in which its own is at `place`, a ``pinocchio.SE3``."""
    if not any(row) or place.isIdentity(0.0):
        return tuple(row)
    numbers, turn = np.asarray(row), np.array(place.rotation)
    com = turn @ numbers[1:4] + np.array(place.translation)
    about = turn @ numbers[_ENTRIES].reshape(3, 3) @ turn.T
    return (row[0], *com.tolist(), *about[SIX].tolist())


def summed(rows: Sequence[Sequence[float]]) -> Numbers:
    """Return the row of several bodies together; of one alone, to the last bit, its own."""
    heavy = [row for row in rows if any(row)]
    if len(heavy) < 2:
        return tuple((heavy or [(0.0,) * 10])[0])
    return row_of(sum(map(inertia_of, heavy[1:]), inertia_of(heavy[0])))


def require_physical(names: Sequence[str], rows: FloatArray, label: str) -> None:
    """Refuse, by its link's name, the first row of (L, 10) with a mass or inertia of no body.

    Principal moments are not negative, and none is larger than the sum of the other two: Ixx + Iyy
    - Izz is twice an integral of z^2.
    """
    bad = ~np.isfinite(rows).all(axis=1) | (rows[:, 0] < 0.0)
    bad[~bad] = impossible(rows[~bad])
    if not bad.any():
        return
    k = int(np.argmax(bad))
    if not np.isfinite(rows[k]).all():
        said = "a finite mass and inertia, got NaN or inf"
    elif rows[k, 0] < 0.0:
        said = f"a mass >= 0 [kg], got {rows[k, 0]:g}"
    else:
        got = ", ".join(f"{moment:.4g}" for moment in _moments(rows[k])[0])
        said = (
            "principal moments of inertia >= 0 [kg m^2] with none above the sum of the others, got "
            f'{got} (inertia = "nearest" takes the closest that a body can have, "accept" these)'
        )
    raise ArmError(f"{label}: link {named(names[k])}: expected {said}")


def impossible(rows: FloatArray, rounding: float = _ROUNDING) -> NDArray[np.bool_]:
    """Return which rows, (L, 10), have a rotational inertia that no body has, (L,)."""
    matrices = rows[:, _ENTRIES].reshape(-1, 3, 3)
    # To one scale: the largest doubles would overflow on the way to their eigenvalues.
    sizes = np.abs(matrices).max(axis=(1, 2))
    sizes = np.where(sizes > 0.0, sizes, 1.0)
    low, middle, high = np.linalg.eigvalsh(matrices / sizes[:, None, None]).T
    negative = np.diagonal(matrices, axis1=1, axis2=2).min(axis=1)
    negligible = _NEGLIGIBLE**2 * np.maximum(rows[:, 0], 0.0)
    # Rounding makes no sign.
    bad = (low + middle - high < -rounding * high - negligible / sizes) | (negative < -negligible)
    return np.asarray(bad)


def nearest_possible(row: Sequence[float]) -> tuple[Numbers, float]:
    """Return the row with the closest rotational inertia that a body can have, and how far it is.

    With second moments s_k >= 0 about the centre of mass, the principal moments are
    s_2 + s_3, s_1 + s_3, s_1 + s_2. Closest is in Frobenius' norm, which leaves the principal axes
    as they are; the distance is relative to the norm of the given inertia.
    """
    from scipy.optimize import nnls

    moments, axes = _moments(row)
    to_moments = 1.0 - np.eye(3)
    second, distance = nnls(to_moments, moments)
    matrix = axes @ np.diag(to_moments @ second) @ axes.T
    return (*row[:4], *matrix[SIX].tolist()), float(distance / np.linalg.norm(moments))


def _moments(row: Any) -> tuple[FloatArray, FloatArray]:
    values, axes = np.linalg.eigh(np.asarray(row)[_ENTRIES].reshape(3, 3))
    return values, axes


# ---------------------------------------------------------------------- shapes

#: How many numbers the size of a shape has, by kind [m]; of a mesh it is the scale.
SIZES = {
    "box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "cone": 2, "ellipsoid": 3, "mesh": 3
}  # fmt: skip
#: Pinocchio's own, where no colour is given.
GREY = (0.9, 0.9, 0.9, 1.0)
#: Characters of an address in a message.
_ADDRESS = 100


@dataclass(frozen=True, eq=False)
class Shape(Description):
    """A solid or a mesh on the joint of this index (-1: the base); colours are within [0, 1].

    Sizes are side lengths, a radius, radii, or a radius and a length along z [m].
    """

    joint: Annotated[int, Whole(low=-1)]
    placement: Placement
    kind: Annotated[str, OneOf(*SIZES)]
    size: Annotated[ArrayLike, Array("m", max_ndim=1)]
    colour: Annotated[ArrayLike, Array(shape=(4,))] = GREY
    path: Annotated[str, Text] = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.floats("size", self.size, shape=(SIZES[self.kind],))


def solid_of(geometry: Any) -> tuple[str, Numbers] | None:
    """Return the kind and size of a solid of coal, Pinocchio's geometry; of all else None."""
    kind = type(geometry).__name__.lower()
    if kind == "box":
        size = 2.0 * np.asarray(geometry.halfSide)
    elif kind == "ellipsoid":
        size = np.asarray(geometry.radii)
    elif kind == "sphere":
        size = np.array([geometry.radius])
    elif kind in SIZES:
        size = np.array([geometry.radius, 2.0 * geometry.halfLength])
    else:
        return None
    return kind, tuple(size.tolist())


def shape_rows(geometry: Any) -> list[dict[str, Any]]:
    """Return tables of `Shape` for a ``pinocchio.GeometryModel``, but for what has none."""
    rows = []
    for thing in geometry.geometryObjects:
        path, found = str(thing.meshPath), solid_of(thing.geometry)
        if found is None and not Path(path).is_file():
            continue
        kind, size = found or ("mesh", np.ravel(thing.meshScale).tolist())
        rows.append({
            "joint": int(thing.parentJoint) - 1, "placement": rows_of(thing.placement),
            "kind": kind, "size": size, "colour": np.ravel(thing.meshColor).tolist(),
            "path": "" if found else path,
        })  # fmt: skip
    return rows


def geometry_of(shapes: Sequence[Shape], label: str) -> Any:
    """Build the ``pinocchio.GeometryModel`` of shapes; warns of meshes that cannot be read."""
    import coal

    geometry, missing = pin.GeometryModel(), list[str]()
    for k, shape in enumerate(shapes):
        size = np.array(shape.size)
        if shape.kind == "mesh":
            try:
                solid = coal.MeshLoader().load(shape.path, size)
            except (RuntimeError, ValueError):
                missing.append(shape.path)
                continue
        else:
            solid = getattr(coal, shape.kind.title())(*size)
        place = placement_of(shape.placement)
        thing = pin.GeometryObject(f"shape{k}", shape.joint + 1, place, solid)
        thing.meshColor = np.array(shape.colour)
        geometry.addGeometryObject(thing)
    if missing:
        warnings.warn(
            f"{cut(label)}: {len(missing)} mesh file(s) not found or not read, first "
            f"{shown(missing[0], _ADDRESS)}: the arm moves as it should but is not drawn whole "
            "(package_dirs says where to look)",
            FpidWarning,
            stacklevel=4,
        )
    return geometry
