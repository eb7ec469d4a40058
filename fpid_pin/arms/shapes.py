"""Visual shapes as plain rows, and as objects of coal, the library of Pinocchio's geometry."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.joints import Placement, placement_of, rows_of
from fpid_pin.checks import Array, OneOf, Text, Whole
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import FpidWarning
from fpid_pin.text import shown

#: How many numbers the size of a shape has, by kind [m]; of a mesh it is the scale.
SIZES = {
    "box": 3, "sphere": 1, "cylinder": 2, "capsule": 2, "cone": 2, "ellipsoid": 3, "mesh": 3
}  # fmt: skip
#: Pinocchio's own, where no colour is given.
GREY = (0.9, 0.9, 0.9, 1.0)
#: Kinds of solid, coal's class for each, and the lengths [m] that it is made from.
_SOLIDS: dict[str, tuple[str, Callable[[Any], Any]]] = {
    "box": ("Box", lambda s: 2.0 * np.asarray(s.halfSide)),
    "sphere": ("Sphere", lambda s: (s.radius,)),
    "cylinder": ("Cylinder", lambda s: (s.radius, 2.0 * s.halfLength)),
    "capsule": ("Capsule", lambda s: (s.radius, 2.0 * s.halfLength)),
    "cone": ("Cone", lambda s: (s.radius, 2.0 * s.halfLength)),
    "ellipsoid": ("Ellipsoid", lambda s: np.asarray(s.radii)),
}
#: Characters of an address in a message.
_ADDRESS = 100


@dataclass(frozen=True, eq=False)
class Shape(Description):
    """A solid or a mesh on the joint of this index (-1: the base); colours are within [0, 1]."""

    joint: Annotated[int, Whole(low=-1)]
    placement: Placement
    kind: Annotated[str, OneOf(*SIZES)]
    size: Annotated[ArrayLike, Array("m", max_ndim=1)]
    colour: Annotated[ArrayLike, Array(shape=(4,))] = GREY
    path: Annotated[str, Text] = ""

    def __post_init__(self) -> None:
        super().__post_init__()
        checks.floats("size", self.size, shape=(SIZES[self.kind],))


def solid_of(geometry: Any) -> tuple[str, tuple[float, ...]] | None:
    """Return the kind of a coal solid and its lengths [m]; None for meshes and scenery.

    ``"box"`` has side lengths, ``"sphere"`` a radius, ``"ellipsoid"`` radii; the others a radius
    and a length along z.
    """
    import coal

    for kind, (name, size) in _SOLIDS.items():
        if isinstance(geometry, getattr(coal, name)):
            return kind, tuple(float(x) for x in size(geometry))
    return None


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
        if shape.kind == "mesh":
            try:
                solid = coal.MeshLoader().load(shape.path, np.array(shape.size))
            except (RuntimeError, ValueError):
                missing.append(shape.path)
                continue
        else:
            solid = getattr(coal, _SOLIDS[shape.kind][0])(*np.asarray(shape.size))
        place = placement_of(shape.placement)
        thing = pin.GeometryObject(f"shape{k}", shape.joint + 1, place, solid)
        thing.meshColor = np.array(shape.colour)
        geometry.addGeometryObject(thing)
    if missing:
        warnings.warn(
            f"{label}: {len(missing)} mesh file(s) not found or not read, first "
            f"{shown(missing[0], _ADDRESS)}: the arm moves as it should but is not drawn whole "
            "(package_dirs says where to look)",
            FpidWarning,
            stacklevel=4,
        )
    return geometry
