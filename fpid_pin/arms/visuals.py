"""Visual geometry of a URDF: where its meshes are, and what to do when they are not."""

from __future__ import annotations

import os
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pinocchio as pin

from fpid_pin.arms.source import one_line
from fpid_pin.arms.urdf_bare import with_visuals
from fpid_pin.exceptions import FpidWarning
from fpid_pin.text import named, shown

#: How many folders above the URDF's own are tried for ``package://name/...``.
_ABOVE = 4
#: Characters of an address in a message.
_ADDRESS = 100


def load(
    model: Any, root: ET.Element, label: str, folder: Path | None, package_dirs: Sequence[str]
) -> Any:
    """Build the visual ``pinocchio.GeometryModel`` of a parsed URDF.

    Parameters
    ----------
    model
        The model that the URDF gives, unreduced.
    root
        The URDF.
    label
        What to call the arm in the warning.
    folder
        The URDF's own folder; None if it was not read from a file.
    package_dirs
        Further folders that hold packages.

    Warns
    -----
    FpidWarning
        When meshes cannot be found, or what is written of a visual cannot be read; those visuals
        are left out, the others are drawn.
    """
    places = _places(folder, package_dirs)
    robot, missing, unclear = with_visuals(root, lambda address: _find(address, places))
    if missing:
        first = shown(missing[0], _ADDRESS)
        warnings.warn(
            f"{label}: {len(missing)} mesh file(s) not found, first {first}: the arm moves "
            "as it should but is not drawn whole (package_dirs says where to look)",
            FpidWarning,
            stacklevel=2,
        )
    if unclear:
        warnings.warn(
            f"{label}: {len(unclear)} visual(s) without one shape of known kind and size, first of "
            f"link {named(unclear[0])}: the arm moves as it should but is not drawn whole",
            FpidWarning,
            stacklevel=2,
        )
    with one_line(label, "its visuals cannot be loaded"):
        text = ET.tostring(robot, encoding="unicode")
        return pin.buildGeomFromUrdfString(model, text, pin.GeometryType.VISUAL)


def _places(folder: Path | None, package_dirs: Sequence[str]) -> list[Path]:
    places = [Path(place) for place in package_dirs]
    if folder is not None:
        places += [folder, *list(folder.parents)[:_ABOVE]]
    places += [Path(place) for place in os.environ.get("ROS_PACKAGE_PATH", "").split(":") if place]
    return places


def _find(address: str, places: Sequence[Path]) -> str | None:
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
        # The system has no file of a name that is too long for it, and says so by an error.
        with suppress(OSError):
            if candidate.is_file():
                return str(candidate.resolve())
    return None
