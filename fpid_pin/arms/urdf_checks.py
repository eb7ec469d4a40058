"""Checking a URDF before Pinocchio sees it, so that every fault has a name and one line."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator, Mapping

from fpid_pin import checks
from fpid_pin.arms.urdf_bare import numbers
from fpid_pin.arms.urdf_bodies import require_bodies
from fpid_pin.arms.urdf_tree import require_chain, require_tree
from fpid_pin.arms.xml_text import parse_xml, require_root
from fpid_pin.exceptions import ArmError
from fpid_pin.text import named

_MOVING = ("revolute", "continuous", "prismatic")
_KINDS = (*_MOVING, "fixed", "floating", "planar")
#: What there may be one of: urdfdom would quietly take the first.
_SINGLE = {
    "link": ("inertial", "mass", "inertia", "origin"),
    "joint": ("parent", "child", "origin", "axis", "limit", "dynamics", "mimic"),
}
#: For links (in <inertial>) and joints: element, attributes, numbers in each, whether it must be.
_NUMBERS = {
    "link": (
        ("mass", ("value",), 1, True),
        ("inertia", ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1, True),
        ("origin", ("xyz", "rpy"), 3, False),
    ),
    "joint": (
        ("origin", ("xyz", "rpy"), 3, False),
        ("axis", ("xyz",), 3, False),
        ("limit", ("lower", "upper", "effort", "velocity"), 1, False),
        ("dynamics", ("damping", "friction"), 1, False),
    ),
}
#: Of an axis: it is divided by its length, which has to survive being squared.
_LENGTHS = (1e-9, 1e9)
#: What makes a joint push where it should hold back, or a limit that nothing keeps.
_NEVER_NEGATIVE = ("damping", "friction", "effort", "velocity")


def parse(text: str, label: str) -> ET.Element:
    """Parse and check a URDF: well formed, one tree of joints between links, numbers that can be.

    Takes time in proportion to the file, whatever is in it.

    Raises
    ------
    ArmError
        One line that names the element at fault.
    """
    root = parse_xml(text, label)
    require_root(root, "robot", label)
    if not root.get("name"):
        raise ArmError(f"{label}: expected a <robot> with a name, got none")
    _require_single(root, label)
    require_tree(root, label)
    for joint in root.findall("joint"):
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None:
            raise ArmError(
                f"{label}: joint {named(joint.get('name'))} ({joint.get('type')}): expected a "
                "<limit> element, got none (a joint without limits is of type continuous)"
            )
    _require_numbers(root, label)
    require_bodies(root, label)
    return root


def _require_single(root: ET.Element, label: str) -> None:
    for kind, tags in _SINGLE.items():
        for owner in root.findall(kind):
            for part in (owner, *owner.findall("inertial")):
                counts = Counter(element.tag for element in part)
                for tag in tags:
                    if counts[tag] > 1:
                        name = named(owner.get("name", ""))
                        raise ArmError(
                            f"{label}: {kind} {name}: expected one <{tag}>, got {counts[tag]}"
                        )


def _require_numbers(root: ET.Element, label: str) -> None:
    """Refuse what should be numbers and is not; urdfdom would only print and give up."""
    for kind, name, tag, attribute, count, required in _numbers(root):
        text = tag.get(attribute)
        if text is None and not required:
            continue
        owner = f"{label}: {kind} {named(name)}: <{tag.tag}>"
        if text is None:
            raise ArmError(f"{owner}: expected the attribute {attribute}, got none")
        values = numbers(text) or []
        # No limit may be written as an infinite one; everything else has to be finite.
        sound = tag.tag == "limit" or all(map(math.isfinite, values))
        if len(values) != count or not sound:
            expected = "a number" if count == 1 else f"{count} numbers"
            raise ArmError(f"{owner}: expected {expected} in {attribute}, got {named(text)}")
        if attribute in _NEVER_NEGATIVE and values[0] < 0.0:
            raise ArmError(f"{owner}: expected {attribute} >= 0, got {values[0]:g}")


def _numbers(root: ET.Element) -> Iterator[tuple[str, str, ET.Element, str, int, bool]]:
    """Yield each element of links and joints that holds numbers (and how many, and if it must)."""
    for kind in ("link", "joint"):
        for owner in root.findall(kind):
            body = owner if kind == "joint" else owner.find("inertial")
            if body is None:
                continue
            for tag, attributes, count, required in _NUMBERS[kind]:
                element = body.find(tag)
                if element is None and kind == "link" and required:
                    element = ET.Element(tag)
                if element is not None:
                    name = owner.get("name", "")
                    for attribute in attributes:
                        yield kind, name, element, attribute, count, required


def require_joints(root: ET.Element, label: str, lock: Mapping[str, float]) -> None:
    """Refuse, by name, a joint that has no axis and no lock, and a lock of an unknown one."""
    kinds = {j.get("name", ""): j.get("type", "") for j in root.findall("joint")}
    movable = [name for name, kind in kinds.items() if kind != "fixed"]
    for name in lock:
        checks.choice("lock", name, movable)
        if kinds[name] not in _MOVING:
            raise ArmError(
                f"{label}: joint {named(name)}: expected a joint with one coordinate to lock, "
                f"got {_kind(kinds[name])}"
            )
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if name in lock or kind == "fixed":
            continue
        if kind not in _MOVING:
            raise ArmError(
                f"{label}: joint {named(name)}: expected revolute, continuous or prismatic, "
                f"got {_kind(kind)}"
            )
        axis = joint.find("axis")
        direction = None if axis is None else axis.get("xyz")
        if direction is not None and not _LENGTHS[0] <= _length(direction) <= _LENGTHS[1]:
            raise ArmError(
                f"{label}: joint {named(name)}: <axis>: expected a direction in xyz, "
                f"got {named(direction)}"
            )
        mimic = joint.find("mimic")
        if mimic is not None:
            raise ArmError(
                f"{label}: joint {named(name)}: expected a joint of its own, got one that mimics "
                f"{named(mimic.get('joint'))} (lock it: lock={{{named(name)}: 0.0}})"
            )
    require_chain(root, label, lock)


def _length(xyz: str) -> float:
    return math.hypot(*(numbers(xyz) or ()))


def _kind(kind: str) -> str:
    return kind if kind in _KINDS else named(kind) if kind else "no type"
