"""Where the base of an MJCF file stands, which Pinocchio's parser passes over."""

from __future__ import annotations

import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path
from typing import Any

import pinocchio as pin

from fpid_pin.arms.source import one_line
from fpid_pin.exceptions import ArmError
from fpid_pin.text import named

_PLACE = ("pos", "quat", "euler", "axisangle", "xyaxes", "zaxis")


def require_one_base(root: ET.Element, label: str) -> None:
    """Refuse a world of no body, or of several: the parser would take the first.

    Bodies within it have names of their own: of those that share one, or have none, it takes one.

    Raises
    ------
    ArmError
        Saying how many there are.
    """
    found = len(root.findall("worldbody/body"))
    if found != 1:
        raise ArmError(f"{label}: expected one <body> in <worldbody>, got {found}")
    for name, count in Counter(body.get("name", "") for body in root.iter("body")).items():
        if not name or count > 1:
            raise ArmError(
                f"{label}: expected bodies with a name of their own, got {named(name)} "
                f"{count} time(s)"
            )


def put_base(model: Any, geometry: Any, root: ET.Element, label: str) -> None:
    """Move a model, and its geometry, to where its file has the base.

    Pinocchio 4.1 puts a body of the world that has no joint at the world's origin, whatever its
    place; one that has a joint it reads right, and is asked for the place by way of such a body.
    """
    base = root.find("worldbody/body")
    if base is None or base.find("joint") is not None or base.find("freejoint") is not None:
        return
    asked = ET.Element("mujoco")
    asked.extend(root.findall("compiler"))
    world = ET.SubElement(asked, "worldbody")
    body = ET.SubElement(world, "body", {k: base.attrib[k] for k in _PLACE if k in base.attrib})
    ET.SubElement(body, "joint", {"name": "there"})
    ET.SubElement(body, "inertial", {"pos": "0 0 0", "mass": "1", "diaginertia": "1 1 1"})
    with tempfile.TemporaryDirectory() as folder, one_line(label, "its base cannot be placed"):
        file = Path(folder) / "base.xml"
        file.write_text(ET.tostring(asked, encoding="unicode"), encoding="utf-8")
        place = pin.buildModelFromMJCF(str(file)).jointPlacements[1].copy()
    for k in range(1, model.njoints):
        if model.parents[k] == 0:
            model.jointPlacements[k] = place * model.jointPlacements[k]
    for frame in list(model.frames)[1:]:
        if frame.parentJoint == 0:
            frame.placement = place * frame.placement
    for thing in [] if geometry is None else geometry.geometryObjects:
        if thing.parentJoint == 0 and not thing.name.startswith("universe"):
            thing.placement = place * thing.placement
