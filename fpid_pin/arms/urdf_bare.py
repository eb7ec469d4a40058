"""A URDF without what is not asked for.

urdfdom reads all of a file and prints to the terminal what it does not understand, names included,
before it gives up. It is shown what has been checked, and no more.
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterator

_MODEL = {
    "link": ("inertial",),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics"),
}
_PLACE = {"xyz": 3, "rpy": 3}
#: Shapes, and how many lengths each attribute holds.
_SHAPES = {
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {},
}
# Python's own reading is wider (1_000, digits of other scripts) than urdfdom's.
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*(e[+-]?\d+)?|\.\d+(e[+-]?\d+)?|inf(inity)?)", re.A | re.I)


def numbers(text: str) -> list[float] | None:
    """Read numbers, some perhaps infinite; None where urdfdom would not read them all."""
    words = text.split()
    return [float(word) for word in words] if all(map(_NUMBER.fullmatch, words)) else None


def bare(root: ET.Element) -> ET.Element:
    """Return the links and joints of a checked URDF, with what makes up a model."""
    robot = ET.Element("robot", {"name": root.get("name", "")})
    for kind, tags in _MODEL.items():
        for part in root.findall(kind):
            copy = ET.SubElement(robot, kind)
            for key in ("name", "type"):
                if key in part.attrib:
                    copy.set(key, part.get(key, ""))
            copy.extend(element for element in part if element.tag in tags)
    return robot


def with_visuals(
    root: ET.Element, find: Callable[[str], str | None]
) -> tuple[ET.Element, list[str], list[str]]:
    """Return `bare` with the visuals that can be drawn.

    Parameters
    ----------
    root
        A checked URDF.
    find
        Takes a mesh's address and returns the file, or None where there is none.

    Returns
    -------
    robot : Element
    missing : list of str
        Addresses of meshes that are left out, as there is no such file.
    unclear : list of str
        Links of which something else is left out: a shape, place or size that cannot be read.
    """
    robot, missing, unclear = bare(root), list[str](), list[str]()
    colours = dict(_colours(root))
    parts = zip(root.findall("link"), robot.findall("link"), strict=True)
    for link, part in parts:
        for visual in link.findall("visual"):
            clean = _visual(visual, colours)
            if clean is None:
                unclear.append(link.get("name", ""))
                continue
            mesh = clean.find("geometry/mesh")
            if mesh is not None:
                address = mesh.get("filename", "")
                found = find(address)
                if found is None:
                    missing.append(address)
                    continue
                mesh.set("filename", found)
            part.append(clean)
    return robot, missing, unclear


def _visual(visual: ET.Element, colours: dict[str, str]) -> ET.Element | None:
    """Return a visual made anew of what is understood of it; None where that is not enough."""
    geometry = visual.find("geometry")
    shapes = [] if geometry is None else list(geometry)
    if len(shapes) != 1 or shapes[0].tag not in _SHAPES:
        return None
    shape, origin = shapes[0], visual.find("origin")
    clean = ET.Element("visual")
    if origin is not None:
        place = _vectors(origin, {key: n for key, n in _PLACE.items() if key in origin.attrib})
        if place is None:
            return None
        ET.SubElement(clean, "origin", place)
    sizes = _vectors(shape, _SHAPES[shape.tag], above=0.0)
    # A scale may mirror.
    scale = _vectors(shape, {"scale": 3}) if "scale" in shape.attrib else {}
    if sizes is None or scale is None:
        return None
    address = {"filename": shape.get("filename", "")} if shape.tag == "mesh" else {}
    ET.SubElement(ET.SubElement(clean, "geometry"), shape.tag, sizes | scale | address)
    material = visual.find("material")
    if material is not None:
        rgba = _rgba(material) or colours.get(material.get("name", ""))
        if rgba is not None:
            ET.SubElement(ET.SubElement(clean, "material", name=rgba), "color", rgba=rgba)
    return clean


def _vectors(
    element: ET.Element, counts: dict[str, int], above: float = -math.inf
) -> dict[str, str] | None:
    """Return attributes that hold so many finite numbers above a bound; None if one does not."""
    found = {}
    for key, count in counts.items():
        values = numbers(element.get(key, ""))
        if values is None or len(values) != count:
            return None
        if not all(above < value < math.inf for value in values):
            return None
        found[key] = " ".join(map(repr, values))
    return found


def _colours(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Yield the names and colours of the materials that a URDF lists for all its links.

    Some files list them at their first use.
    """
    for material in root.iter("material"):
        rgba = _rgba(material)
        if rgba is not None:
            yield material.get("name", ""), rgba


def _rgba(material: ET.Element) -> str | None:
    colour = material.find("color")
    found = None if colour is None else _vectors(colour, {"rgba": 4})
    return None if found is None else found["rgba"]
