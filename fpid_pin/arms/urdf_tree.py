"""Whether the links and joints of a URDF are one tree, told in time linear in the file."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Collection, Mapping

from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, listed, named

#: Joints from the base to a tip, at most: urdfdom calls itself once for each, and at some ten
#: thousand its stack ends, and the process with it.
DEEPEST = 500
#: Links, and joints that are not fixed, at most. Pinocchio looks names up one by one, and its
#: tables grow with the cube of the joints, locked ones included: 0.6 GB for 200.
MOST_LINKS, MOST_JOINTS = 5000, 200


def require_tree(root: ET.Element, label: str) -> None:
    """Refuse links and joints that are not one tree, with names of their own and a base.

    Raises
    ------
    ArmError
        Naming the link or joint at fault.
    """
    links = _own_names(root, "link", label)
    joints = _own_names(root, "joint", label)
    if not links:
        raise ArmError(f"{label}: expected links, got none")
    below: dict[str, list[str]] = {}
    children: set[str] = set()
    for name, joint in joints.items():
        parent, child = (_end(joint, name, end, links, label) for end in ("parent", "child"))
        if child in children:
            raise ArmError(f"{label}: expected one joint above link {named(child)}, got several")
        children.add(child)
        below.setdefault(parent, []).append(child)
    bases = [link for link in links if link not in children]
    if len(bases) != 1:
        where = f": {listed(bases, _plain)}" if bases else ", each link has a joint above it"
        raise ArmError(f"{label}: expected one base link, got {len(bases)}{where}")
    reached = _require_shallow(bases[0], below, label)
    apart = [link for link in links if link not in reached]
    if apart:
        raise ArmError(
            f"{label}: expected every link below the base {named(bases[0])}, got {len(apart)} "
            f"in a cycle: {listed(apart)}"
        )
    if len(links) > MOST_LINKS:
        raise ArmError(f"{label}: expected at most {MOST_LINKS} links, got {len(links)}")


def require_chain(root: ET.Element, label: str, held: Collection[str]) -> None:
    """Refuse a tree whose joints that move are not one behind the other, or are too many.

    Pinocchio would be asked, but takes its time over a tree of thousands.

    Parameters
    ----------
    root
        What `require_tree` let pass.
    label
        What to call it.
    held
        Joints that do not move, besides the fixed ones.

    Raises
    ------
    ArmError
        Naming the joints that leave one place.
    """
    above = {_link(joint, "child"): joint for joint in root.findall("joint")}
    movable = {
        joint.get("name", ""): _link(joint, "parent")
        for joint in above.values()
        if joint.get("type") != "fixed"
    }
    if len(movable) > MOST_JOINTS:
        raise ArmError(
            f"{label}: expected at most {MOST_JOINTS} joints that are not fixed, got {len(movable)}"
        )
    moving = {name: link for name, link in movable.items() if name not in held}
    leaving: dict[str, list[str]] = {}
    for name, link in moving.items():
        # Up to the joint that moves this one; the base has none above it.
        joint, place = above.get(link), ""
        while joint is not None and (place := joint.get("name", "")) not in moving:
            joint, place = above.get(_link(joint, "parent")), ""
        leaving.setdefault(place, []).append(name)
    for place, names in leaving.items():
        if len(names) > 1:
            where = f"joint {named(place)}" if place else "its base"
            raise ArmError(
                f"{label}: expected a serial chain, got a tree that branches at {where} into "
                f"{listed(names)} (lock the joints of all branches but one)"
            )


def _own_names(root: ET.Element, kind: str, label: str) -> dict[str, ET.Element]:
    """Return the links or the joints by name."""
    found = root.findall(kind)
    counts = Counter(element.get("name", "") for element in found)
    for name, count in counts.items():
        if not name or count > 1:
            raise ArmError(
                f"{label}: expected {kind}s with a name of their own, got {named(name)} "
                f"{count} time(s)"
            )
    return {element.get("name", ""): element for element in found}


def _end(
    joint: ET.Element, name: str, end: str, links: Mapping[str, ET.Element], label: str
) -> str:
    """Return the link at one end of a joint."""
    link = _link(joint, end)
    if link not in links:
        raise ArmError(
            f"{label}: joint {named(name)}: expected a {end} link of the file, got {named(link)}"
        )
    return link


def _link(joint: ET.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _require_shallow(base: str, below: Mapping[str, list[str]], label: str) -> set[str]:
    """Walk down from the base, a level at a time, and return what is reached."""
    level, reached = [base], {base}
    for _ in range(DEEPEST + 1):
        level = [child for link in level for child in below.get(link, ())]
        if not level:
            return reached
        reached.update(level)
    raise ArmError(
        f"{label}: expected at most {DEEPEST} joints from the base to a tip, "
        f"got more above link {named(level[0])}"
    )


def _plain(name: object) -> str:
    return cut(str(name))
