"""Visual geometry of a URDF: where its meshes are, and what to do when they are not."""

from __future__ import annotations

import os
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pinocchio as pin

from fpid_pin.arms.source import one_line
from fpid_pin.exceptions import FpidWarning

#: How many folders above the URDF's own are tried for ``package://name/...``.
_ABOVE = 4


def load(
    model: Any, root: ET.Element, label: str, folder: Path | None, package_dirs: Sequence[str]
) -> Any:
    """Build the visual ``pinocchio.GeometryModel`` of a parsed URDF.

    Parameters
    ----------
    model
        The model that the URDF gives, unreduced.
    root
        The URDF; its mesh addresses are resolved in place.
    label
        What to call the arm in the warning.
    folder
        The URDF's own folder; None if it was not read from a file.
    package_dirs
        Further folders that hold packages.

    Warns
    -----
    FpidWarning
        When meshes cannot be found; those visuals are left out, the others are drawn.
    """
    places = _places(folder, package_dirs)
    missing: list[str] = []
    for link in root.findall("link"):
        for visual in link.findall("visual"):
            mesh = visual.find("geometry/mesh")
            if mesh is None:
                continue
            address = mesh.get("filename", "")
            found = _find(address, places)
            if found is None:
                missing.append(address)
                link.remove(visual)
            else:
                mesh.set("filename", str(found))
    if missing:
        warnings.warn(
            f"{label}: {len(missing)} mesh file(s) not found, first {missing[0]!r}: the arm moves "
            "as it should but is not drawn whole (package_dirs says where to look)",
            FpidWarning,
            stacklevel=2,
        )
    with one_line(label, "its visuals cannot be loaded"):
        text = ET.tostring(root, encoding="unicode")
        return pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)


def _places(folder: Path | None, package_dirs: Sequence[str]) -> list[Path]:
    places = [Path(place) for place in package_dirs]
    if folder is not None:
        places += [folder, *list(folder.parents)[:_ABOVE]]
    places += [Path(place) for place in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if place]
    return places


def _find(address: str, places: Sequence[Path]) -> Path | None:
    """Resolve ``package://``, ``model://``, ``file://``, absolute and relative addresses."""
    scheme, separator, rest = address.partition("://")
    if separator and scheme in ("package", "model"):
        candidates = [place / rest for place in places]
        # A package's own folder may be given, whatever it is called on this disk.
        candidates += [place / rest.partition("/")[2] for place in places]
    else:
        path = Path(rest if separator else address)
        candidates = [path] if path.is_absolute() else [place / path for place in places]
    for candidate in candidates:
        if candidate.is_file():
            return candidate.resolve()
    return None
