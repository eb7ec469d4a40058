"""Visual shapes of a URDF, and where its meshes are."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.arms.joints import rows_of
from fpid_pin.arms.spec import GREY, Shape

#: How many folders above the URDF's own are tried for ``package://name/...``.
_ABOVE = 4
#: Attributes that hold a shape's lengths, and how many each.
_SIZES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
}


class Visuals:
    """Reads the visuals of links; colours may be given once for all links, some at first use."""

    def __init__(
        self, root: ET.Element, folder: Path | None, package_dirs: Sequence[str | Path]
    ) -> None:
        self._places = [Path(place) for place in package_dirs]
        if folder is not None:
            self._places += [folder, *list(folder.parents)[:_ABOVE]]
        paths = os.environ.get("ROS_PACKAGE_PATH", "").split(":")
        self._places += [Path(place) for place in paths if place]
        self._colours: dict[str, tuple[float, ...]] = {}
        for material in root.iter("material"):
            with suppress(ValueError):
                self._colours[material.get("name", "")] = _rgba(material)

    def shapes(self, link: ET.Element, joint: int, place: Any) -> tuple[list[Shape], bool]:
        """Return a link's shapes, on its joint, and whether there are others that are not clear.

        A mesh that is not found keeps its address as its path.
        """
        shapes, unclear = list[Shape](), False
        for visual in link.findall("visual"):
            try:
                shapes.append(self._shape(visual, joint, place))
            except ValueError:
                unclear = True
        return shapes, unclear

    def _shape(self, visual: ET.Element, joint: int, place: Any) -> Shape:
        (solid,) = visual.findall("geometry/*")
        if solid.tag not in _SIZES:
            raise ValueError(solid.tag)
        lengths = _SIZES[solid.tag].items()
        absent = "1 1 1" if solid.tag == "mesh" else ""
        size = [x for key, n in lengths for x in _numbers(solid, key, n, absent)]
        if solid.tag != "mesh" and min(size) <= 0.0:
            raise ValueError(size)
        material, colour = visual.find("material"), tuple[float, ...](GREY)
        if material is not None:
            colour = self._colours.get(material.get("name", ""), GREY)
            with suppress(ValueError):
                colour = _rgba(material)
        path = self._find(solid.get("filename", "")) if solid.tag == "mesh" else ""
        pose = rows_of(place * pose_of(visual.find("origin")))
        return Shape(joint, pose, solid.tag, tuple(size), colour, path)

    def _find(self, address: str) -> str:
        """Resolve ``package://``, ``model://``, ``file://``, absolute and relative addresses."""
        scheme, separator, rest = address.partition("://")
        if separator and scheme in ("package", "model"):
            candidates = [place / rest for place in self._places]
            # A package's own folder may be given, whatever it is called on this disk.
            candidates += [place / rest.partition("/")[2] for place in self._places]
        else:
            path = Path(rest if separator else address)
            candidates = [place / path for place in self._places] or [path]
        for candidate in candidates:
            # The system has no file of a name that is too long for it, and says so by an error.
            with suppress(OSError, ValueError):
                if candidate.is_file():
                    return str(candidate.resolve())
        return address


def pose_of(origin: ET.Element | None) -> Any:
    """Return the ``pinocchio.SE3`` of an ``<origin>``; None: where its owner is."""
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (np.array(_numbers(origin, key, 3, "0 0 0")) for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _rgba(material: ET.Element) -> tuple[float, ...]:
    colour = material.find("color")
    return tuple(_numbers(material if colour is None else colour, "rgba", 4))


def _numbers(element: ET.Element, key: str, count: int, absent: str = "") -> list[float]:
    """Return an attribute's numbers; raises ValueError where they are not so many finite ones."""
    values = [float(word) for word in element.get(key, absent).split()]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError(key)
    return values
