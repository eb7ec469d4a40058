"""Visual shapes as plain rows, and as objects of coal, the library of Pinocchio's geometry."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.arms.joints import placement_of, rows_of
from fpid_pin.arms.spec import Shape
from fpid_pin.exceptions import FpidWarning
from fpid_pin.text import shown

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


def shape_of(thing: Any) -> Shape | None:
    """Return a ``pinocchio.GeometryObject`` as a shape; None for what cannot be drawn from one."""
    path = str(thing.meshPath)
    found = solid_of(thing.geometry)
    if found is None and not Path(path).is_file():
        return None
    kind, size = found or ("mesh", tuple(float(x) for x in np.ravel(thing.meshScale)))
    colour = tuple(float(x) for x in np.ravel(thing.meshColor))
    place = rows_of(thing.placement)
    return Shape(int(thing.parentJoint) - 1, place, kind, size, colour, "" if found else path)


def geometry_of(shapes: Sequence[Shape], label: str) -> Any:
    """Build the ``pinocchio.GeometryModel`` of shapes.

    Warns
    -----
    FpidWarning
        When meshes cannot be read; the others are drawn.
    """
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
            solid = getattr(coal, _SOLIDS[shape.kind][0])(*shape.size)
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
