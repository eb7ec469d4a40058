"""Checking a URDF before Pinocchio sees it, so that every fault has a name and one line."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping

from fpid_pin import checks
from fpid_pin.exceptions import ArmError

_TURNING = ("revolute", "continuous")
_LOCKABLE = (*_TURNING, "prismatic")
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


def parse(text: str, label: str) -> ET.Element:
    """Parse and check a URDF: well formed, one root link, every joint between known links.

    Raises
    ------
    ArmError
        One line that names the element at fault.
    """
    try:
        root = ET.fromstring(text)
    except ET.ParseError as error:
        raise ArmError(f"{label}: expected well-formed XML, got {error}") from None
    if root.tag != "robot":
        raise ArmError(f"{label}: expected a <robot> element, got <{root.tag}>")
    links = [link.get("name", "") for link in root.findall("link")]
    joints = root.findall("joint")
    names = [joint.get("name", "") for joint in joints]
    for what, listed in (("link", links), ("joint", names)):
        for name in listed:
            if not name or listed.count(name) > 1:
                raise ArmError(
                    f"{label}: expected {what}s with a name of their own, got {name!r} "
                    f"{listed.count(name)} time(s)"
                )
    if not links:
        raise ArmError(f"{label}: expected links, got none")
    children: set[str] = set()
    for joint, name in zip(joints, names, strict=True):
        for end in ("parent", "child"):
            element = joint.find(end)
            link = "" if element is None else element.get("link", "")
            if link not in links:
                raise ArmError(
                    f"{label}: joint {name!r}: expected a {end} link of the file, got {link!r}"
                )
            if end == "child" and link in children:
                raise ArmError(f"{label}: expected one joint above link {link!r}, got several")
            if end == "child":
                children.add(link)
        if joint.get("type") in ("revolute", "prismatic") and joint.find("limit") is None:
            raise ArmError(
                f"{label}: joint {name!r} ({joint.get('type')}): expected a <limit> element, "
                "got none (a joint without limits is of type continuous)"
            )
    bases = [link for link in links if link not in children]
    if len(bases) != 1:
        raise ArmError(f"{label}: expected one base link, got {len(bases)}: {', '.join(bases)}")
    return root


def require_numbers(root: ET.Element, label: str) -> None:
    """Refuse what should be numbers and is not; urdfdom would only print and give up."""
    for kind, name, tag, attribute, count, required in _numbers(root):
        owner = f"{label}: {kind} {name!r}: <{tag.tag}>"
        text = tag.get(attribute)
        if text is None:
            if required:
                raise ArmError(f"{owner}: expected the attribute {attribute}, got none")
            continue
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        # No limit may be written as an infinite one; everything else has to be finite.
        admissible = (lambda x: not math.isnan(x)) if tag.tag == "limit" else math.isfinite
        if len(values) != count or not all(map(admissible, values)):
            expected = "a number" if count == 1 else f"{count} numbers"
            raise ArmError(f"{owner}: expected {expected} in {attribute}, got {text!r}")


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
    """Refuse, by name, a joint that neither turns nor is locked, and a lock of an unknown one."""
    kinds = {j.get("name", ""): j.get("type", "") for j in root.findall("joint")}
    movable = [name for name, kind in kinds.items() if kind != "fixed"]
    for name in lock:
        checks.choice("lock", name, movable)
        if kinds[name] not in _LOCKABLE:
            raise ArmError(
                f"{label}: joint {name!r}: expected a joint with one coordinate to lock, "
                f"got {kinds[name]}"
            )
    for joint in root.findall("joint"):
        name, kind = joint.get("name", ""), joint.get("type", "")
        if name in lock or kind == "fixed":
            continue
        if kind not in _TURNING:
            hint = f" (lock it: lock={{{name!r}: 0.0}})" if kind in _LOCKABLE else ""
            raise ArmError(
                f"{label}: joint {name!r}: expected revolute or continuous, got {kind or 'no type'}"
                + hint
            )
        mimic = joint.find("mimic")
        if mimic is not None:
            raise ArmError(
                f"{label}: joint {name!r}: expected a joint of its own, got one that mimics "
                f"{mimic.get('joint')!r} (lock it)"
            )
