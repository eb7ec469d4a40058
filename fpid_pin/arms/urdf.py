"""Reading a URDF: urdfdom and Pinocchio make the model, and say what is wrong with it."""

from __future__ import annotations

import math
import os
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin.arms.inertia import moved
from fpid_pin.arms.pinocchio_model import tree_of
from fpid_pin.arms.robot_file import one_line, parse_xml, require_root
from fpid_pin.arms.spec import MOST_JOINTS
from fpid_pin.arms.tree import Body, Tree
from fpid_pin.arms.urdf_visuals import Visuals, pose_of
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, listed, named

#: urdfdom calls itself once for each link of a chain; at some ten thousand its stack ends, and the
#: process with it.
MOST_LINKS = 2000
_TO_SET = "(with_limits sets one)"


def urdf_tree(
    text: bytes | str,
    label: str,
    folder: Path | None = None,
    package_dirs: Sequence[str | Path] = (),
) -> Tree:
    """Read a URDF; what urdfdom and Pinocchio accept is accepted, and what they refuse is refused.

    Parameters
    ----------
    text
        The URDF itself.
    label
        What to call it in a message: its path.
    folder, package_dirs
        Where to look for meshes: at and above the file's folder, and in these.

    Raises
    ------
    ArmError
    """
    label = cut(label)
    root = parse_xml(text, label)
    require_root(root, "robot", label)
    _require_single(root, label)
    _require_few(root, label)
    remarks = list(_mend_limits(root))
    model = _model(root, label)
    places = {str(f.name): f for f in model.frames if f.type == pin.FrameType.BODY}
    lost = [link.get("name", "") for link in root.findall("link") if link.get("name") not in places]
    if lost:
        raise ArmError(
            f"{label}: expected every link below the base, got {len(lost)} apart: {listed(lost)}"
        )
    tree = tree_of(model, label)
    tree.bodies = [_body(link, places[link.get("name", "")]) for link in root.findall("link")]
    for name, remark in remarks:
        tree.remark(name, remark)
    for body in tree.bodies:
        if body.joint >= 0 and body.inertia[0] == 0.0 and any(body.inertia[4:]):
            tree.remark(body.name, "mass 0 with a rotational inertia, which is kept")
    for k, joint in enumerate(tree.joints):
        # Where a held joint stands: as drawn, or as near to it as its limits let it.
        tree.rest[k] = float(np.clip(0.0, joint.lower, joint.upper))
    for element in root.findall("joint"):
        mimic = element.find("mimic")
        if mimic is not None and element.get("name") in {joint.name for joint in tree.joints}:
            scale = [float(mimic.get(k, d)) for k, d in (("multiplier", "1"), ("offset", "0"))]
            tree.mimics[element.get("name", "")] = (mimic.get("joint", ""), scale[0], scale[1])
    visuals = Visuals(root, folder, package_dirs)
    for link in root.findall("link"):
        frame = places[link.get("name", "")]
        shapes, unclear = visuals.shapes(link, int(frame.parentJoint) - 1, frame.placement)
        tree.shapes += shapes
        if unclear:
            tree.remark(
                link.get("name", ""), "a visual without one shape of known size is not drawn"
            )
    return tree


def _require_single(root: ET.Element, label: str) -> None:
    """Drop what is written twice alike; urdfdom would quietly take the first of what differs."""
    for owner in [part for kind in ("link", "joint") for part in root.findall(kind)]:
        for parent in (owner, *owner.findall("inertial")):
            seen: dict[str, bytes] = {}
            for part in list(parent):
                written = b"".join(ET.tostring(part).split())
                if part.tag in ("visual", "collision"):
                    continue
                if seen.setdefault(part.tag, written) != written:
                    raise ArmError(
                        f"{label}: {owner.tag} {named(owner.get('name', ''))}: expected one "
                        f"<{cut(part.tag)}>, got several that differ"
                    )


def _require_few(root: ET.Element, label: str) -> None:
    moving = sum(joint.get("type") != "fixed" for joint in root.findall("joint"))
    for most, count, what in (
        (MOST_LINKS, len(root.findall("link")), "links"),
        (MOST_JOINTS, moving, "joints that are not fixed"),
    ):
        if count > most:
            raise ArmError(f"{label}: expected at most {most} {what}, got {count}")


def _mend_limits(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Write limits as urdfdom takes them; yield joints, and what was made of their limits.

    It insists on effort and velocity (0: none) and does not know inf.
    """
    for joint in root.findall("joint"):
        name, limit = joint.get("name", ""), joint.find("limit")
        if limit is None or joint.get("type") == "fixed":
            continue
        for key in ("effort", "velocity"):
            value = _number(limit.get(key, "inf"))
            if value <= 0.0:
                yield name, f"{key} {value:g} is taken as no limit {_TO_SET}"
            if value < 0.0 or math.isinf(value):
                limit.set(key, "0")
        bounds = [_number(limit.get(key, "0")) for key in ("lower", "upper")]
        for key, value in zip(("lower", "upper"), bounds, strict=True):
            if math.isinf(value):
                limit.set(key, f"{math.copysign(1e6, value):g}")
        if joint.get("type") == "continuous":
            if any(bounds):
                yield name, "lower and upper are not used, as the joint is continuous"
        elif bounds[0] >= bounds[1]:
            yield (
                name,
                f"lower {bounds[0]:g} is not below upper {bounds[1]:g}, taken as no limits "
                f"{_TO_SET.replace('one', 'them')}",
            )


def _number(text: str) -> float:
    """Read a number; NaN where it is none, which urdfdom says."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _model(root: ET.Element, label: str) -> Any:
    """Let urdfdom and Pinocchio build the model; of several errors the first ones say most."""
    bare = ET.Element("robot", root.attrib)
    for part in [*root.findall("link"), *root.findall("joint")]:
        copy = ET.SubElement(bare, part.tag, part.attrib)
        copy.extend(e for e in part if e.tag not in ("visual", "collision"))
    said = list[str]()
    try:
        with one_line(f"{label}: Pinocchio cannot build it"), _native_errors(said):
            model = pin.buildModelFromXML(ET.tostring(bare, encoding="unicode"))
    except ArmError:
        if not said:
            raise
    if said:
        # It leaves out an inertia, say, that it cannot read.
        raise ArmError(f"{label}: {'; '.join(said[:2])}")
    return model


@contextmanager
def _native_errors(said: list[str]) -> Iterator[None]:
    """Collect the errors that a compiled library writes to the terminal."""
    sys.stderr.flush()
    terminal = os.dup(2)
    with tempfile.TemporaryFile() as file:
        os.dup2(file.fileno(), 2)
        try:
            yield
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
            file.seek(0)
            text = file.read().decode("utf-8", "replace")
            said += re.findall(r"^Error:\s+(.*?)\s*(?=^ *at line|\Z)", text, re.M | re.S)


def _body(link: ET.Element, frame: Any) -> Body:
    """Return a link, in the frame of the joint that carries it; urdfdom has read its numbers."""
    name, joint = link.get("name", ""), int(frame.parentJoint) - 1
    inertial = link.find("inertial")
    if inertial is None:
        return Body(name, joint, (0.0,) * 10)
    about, mass = inertial.find("inertia"), inertial.find("mass")
    assert about is not None
    assert mass is not None
    xx, xy, yy, xz, yz, zz = (
        float(about.get(key, "0")) for key in ("ixx", "ixy", "iyy", "ixz", "iyz", "izz")
    )
    row = (float(mass.get("value", "0")), 0.0, 0.0, 0.0, xx, xy, yy, xz, yz, zz)
    return Body(name, joint, moved(moved(row, pose_of(inertial.find("origin"))), frame.placement))
