"""Visual shapes of coal, the library of Pinocchio's geometry, as plain rows, and back."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.text import shown

#: Kinds of solid, coal's class for each, how many lengths [m] it is made from, and which they are.
_SOLIDS: dict[str, tuple[str, int, Callable[[Any], Any]]] = {
    "box": ("Box", 3, lambda s: 2.0 * np.asarray(s.halfSide)),
    "sphere": ("Sphere", 1, lambda s: (s.radius,)),
    "cylinder": ("Cylinder", 2, lambda s: (s.radius, 2.0 * s.halfLength)),
    "capsule": ("Capsule", 2, lambda s: (s.radius, 2.0 * s.halfLength)),
    "cone": ("Cone", 2, lambda s: (s.radius, 2.0 * s.halfLength)),
    "ellipsoid": ("Ellipsoid", 3, lambda s: np.asarray(s.radii)),
}
#: Keys of a row; of a mesh `size` is the scale.
ROW = ("joint", "placement", "kind", "size", "colour", "path")


def solid_of(geometry: Any) -> tuple[str, tuple[float, ...]] | None:
    """Return the kind of a coal solid and its lengths [m]; None for meshes and scenery.

    ``"box"`` has side lengths, ``"sphere"`` a radius, ``"ellipsoid"`` radii; the others a radius
    and a length along z.
    """
    import coal

    for kind, (name, _, size) in _SOLIDS.items():
        if isinstance(geometry, getattr(coal, name)):
            return kind, tuple(float(x) for x in size(geometry))
    return None


def row_of(thing: Any) -> dict[str, Any] | None:
    """Return a ``pinocchio.GeometryObject`` as a row; None for what cannot be drawn from one."""
    path = str(thing.meshPath)
    found = solid_of(thing.geometry)
    if found is None and not Path(path).is_file():
        return None
    kind, size = found or ("mesh", tuple(float(x) for x in np.ravel(thing.meshScale)))
    row: dict[str, Any] = {
        "joint": int(thing.parentJoint) - 1,
        "placement": placement_rows(thing.placement),
        "kind": kind,
        "size": list(size),
        "colour": [float(x) for x in np.ravel(thing.meshColor)],
    }
    return row | {"path": path} if kind == "mesh" else row


def require_row(row: Any, name: str, joints: int) -> None:
    """Refuse, as the argument `name`, what is not a row of a shape on an arm with `joints`."""
    if not isinstance(row, Mapping):
        raise ArgumentError(name, "a table", shown(row))
    for key in row:
        checks.choice(f"key in {name}", key, ROW)
    checks.integer(f"{name}.joint", row.get("joint"), low=-1, high=joints - 1)
    placement_of(row.get("placement"), f"{name}.placement")
    kind = checks.choice(f"{name}.kind", row.get("kind"), (*_SOLIDS, "mesh"))
    count = 3 if kind == "mesh" else _SOLIDS[kind][1]
    for key, length in (("size", count), ("colour", 4)):
        shaped(f"{name}.{key}", row.get(key), (length,))
    if kind == "mesh":
        checks.instance(f"{name}.path", row.get("path"), str, "a mesh's file")


def geometry_of(rows: Sequence[Mapping[str, Any]], label: str) -> Any:
    """Build the ``pinocchio.GeometryModel`` of rows.

    Warns
    -----
    FpidWarning
        When meshes cannot be read; the others are drawn.
    """
    import coal

    geometry, missing = pin.GeometryModel(), list[str]()
    for k, row in enumerate(rows):
        size = [float(x) for x in row["size"]]
        if row["kind"] == "mesh":
            try:
                solid = coal.MeshLoader().load(row["path"], np.array(size))
            except (RuntimeError, ValueError):
                missing.append(row["path"])
                continue
        else:
            solid = getattr(coal, _SOLIDS[row["kind"]][0])(*size)
        place = placement_of(row["placement"], "placement")
        thing = pin.GeometryObject(f"shape{k}", int(row["joint"]) + 1, place, solid)
        thing.meshColor = np.array(row["colour"], dtype=np.float64)
        geometry.addGeometryObject(thing)
    if missing:
        warnings.warn(
            f"{label}: {len(missing)} mesh(es) cannot be read, first {shown(missing[0], 100)}: the "
            "arm moves as it should but is not drawn whole",
            FpidWarning,
            stacklevel=2,
        )
    return geometry


def rows_of(things: Iterable[Any]) -> list[dict[str, Any]]:
    """Return the rows of those ``pinocchio.GeometryObject`` that have one."""
    return [row for row in map(row_of, things) if row is not None]


def placement_rows(placement: Any) -> list[list[float]]:
    """Return a ``pinocchio.SE3`` as the upper three rows of its (4, 4) matrix."""
    return [[float(x) for x in row] for row in np.asarray(placement.homogeneous)[:3]]


def placement_of(rows: Any, name: str) -> Any:
    """Build a ``pinocchio.SE3`` from three rows of four numbers: a rotation and where [m].

    Raises
    ------
    ArgumentError
        Other shapes, or a rotation that is none.
    """
    matrix = shaped(name, rows, (3, 4))
    rotation = matrix[:, :3]
    near = np.abs(rotation @ rotation.T - np.eye(3)).max() < 1e-6
    if not near or np.linalg.det(rotation) < 0.0:
        raise ArgumentError(name, "a rotation in its first three columns", rotation.tolist())
    return pin.SE3(np.array(rotation), np.array(matrix[:, 3]))


def shaped(name: str, value: Any, shape: tuple[int, ...]) -> FloatArray:
    """Return finite numbers of one shape; else one line that names them."""
    array = checks.floats(name, () if value is None else value)
    if array.shape != shape:
        raise ArgumentError(name, f"shape {shape}", f"shape {array.shape}")
    return array
