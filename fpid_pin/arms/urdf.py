"""From a URDF to a `Tree`: urdfdom and Pinocchio make the model, and say what is wrong with it."""

import math
import os
import re
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from fpid_pin import checks
from fpid_pin.arms.chain import MOST_JOINTS, Row
from fpid_pin.arms.parts import GREY, SIZES, UNITS, moved, rows_of
from fpid_pin.arms.robot_file import one_line, parse_xml, read_robot
from fpid_pin.arms.tree import Body, Tree, tree_of
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, listed, named

#: urdfdom calls itself once for each link of a chain; at some ten thousand its stack ends, and the
#: process with it.
MOST_LINKS = 2000
#: How many folders above the URDF's own are tried for ``package://name/...``.
_ABOVE = 4
#: Attributes that hold a shape's lengths: a size or a scale are three.
_LENGTHS = {
    "box": ("size",), "cylinder": ("radius", "length"), "capsule": ("radius", "length"),
    "sphere": ("radius",), "mesh": ("scale",),
}  # fmt: skip
#: Attributes of a limit, and what they are where they are left out.
_LIMITS = {"effort": "inf", "velocity": "inf", "lower": "0", "upper": "0"}
#: Numbers of a joint that mimics another, as they are by default.
_MIMIC = ("multiplier", "1"), ("offset", "0")
_TO_SET = "(with_limits, in files changes = [{ limits = ... }], sets one)"


def urdf_tree(
    path: str | Path | None, urdf: str | None = None, package_dirs: Sequence[str | Path] = ()
) -> Tree:
    """Read a URDF; what urdfdom and Pinocchio accept is accepted, what they refuse is refused.

    `urdf` is its text, in place of what the file has. Meshes are looked up at and above the file,
    and in `package_dirs`.
    """
    if path is not None or urdf is None:
        checks.instance("path", path, (str, Path), "the path of a URDF file")
    checks.instance("package_dirs", package_dirs, (list, tuple), "a list of folders")
    for k, place in enumerate(package_dirs):
        checks.instance(f"package_dirs.{k}", place, (str, Path), "a folder")
    given = None if urdf is None else checks.plain("urdf", urdf, str, "the text of a URDF")
    folder = None if path is None else Path(path).absolute().parent
    label = cut(str(path or "URDF"))
    root = parse_xml(read_robot(path or "") if given is None else given, label, "robot")
    _require_single(root, label)
    _require_few(root, label)
    remarks = list(_fix_limits(root))
    model = _model(root, label)
    places = {str(f.name): f for f in model.frames if f.type == pin.FrameType.BODY}
    lost = [link.get("name", "") for link in root.findall("link") if link.get("name") not in places]
    if lost:
        raise ArmError(
            f"{label}: expected every link below the base, got {len(lost)} apart: {listed(lost)}"
        )
    tree = tree_of(model)
    tree.label = label
    tree.bodies = [_body(link, places[link.get("name", "")]) for link in root.findall("link")]
    for name, remark in remarks:
        tree.remark(name, remark)
    for body in tree.bodies:
        if body.joint >= 0 and body.inertia[0] == 0.0 and any(body.inertia[4:]):
            tree.remark(body.name, "mass 0 with a rotational inertia, which is kept")
    for row in tree.joints:
        # Where a held joint stands: as drawn, or as near to it as its limits let it.
        if row["kind"] in UNITS:
            tree.rest[row["name"]] = float(np.clip(0.0, row["lower"], row["upper"]))
    for element in root.findall("joint"):
        mimic = element.find("mimic")
        if mimic is not None and element.get("name") in tree.names:
            factor, offset = (float(mimic.get(k, d)) for k, d in _MIMIC)
            tree.followers[element.get("name", "")] = (mimic.get("joint", ""), factor, offset)
    _add_visuals(tree, root, places, _folders(folder, package_dirs))
    return tree


def _require_single(root: ET.Element, label: str) -> None:
    """Refuse what is written twice and differs: urdfdom would quietly take the first."""
    for owner in [part for kind in ("link", "joint") for part in root.findall(kind)]:
        for parent in (owner, *owner.findall("inertial")):
            seen: dict[str, ET.Element] = {}
            for part in parent:
                first = seen.setdefault(part.tag, part)
                if part is first or part.tag in ("visual", "collision"):
                    continue
                if ET.tostring(part).split() != ET.tostring(first).split():
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


def _fix_limits(root: ET.Element) -> Iterator[tuple[str, str]]:
    """Write limits as urdfdom takes them; yield joints, and what was made of their limits.

    It insists on effort and velocity (0: none) and does not know inf.
    """
    for joint in root.findall("joint"):
        name, limit = joint.get("name", ""), joint.find("limit")
        if limit is None or joint.get("type") == "fixed":
            continue
        given = {key: _number(limit.get(key, none)) for key, none in _LIMITS.items()}
        for key in ("effort", "velocity"):
            if given[key] <= 0.0:
                yield name, f"{key} {given[key]:g} is taken as no limit {_TO_SET}"
            if given[key] < 0.0 or math.isinf(given[key]):
                limit.set(key, "0")
        for key in ("lower", "upper"):
            if math.isinf(given[key]):
                limit.set(key, f"{math.copysign(1e6, given[key]):g}")
        lower, upper = given["lower"], given["upper"]
        if joint.get("type") == "continuous":
            if lower or upper:
                yield name, "lower and upper are not used, as the joint is continuous"
        elif lower >= upper:
            said = f"lower {lower:g} is not below upper {upper:g}, taken as no limits"
            yield name, f"{said} {_TO_SET.replace('one', 'them')}"


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
    return Body(name, joint, moved(moved(row, _pose(inertial.find("origin"))), frame.placement))


# ---------------------------------------------------------------------- what is drawn


def _folders(folder: Path | None, package_dirs: Sequence[str | Path]) -> list[Path]:
    """Return where to look for meshes: where told, beside and above the file, where ROS does."""
    above = [] if folder is None else [folder, *list(folder.parents)[:_ABOVE]]
    ros = filter(None, os.environ.get("ROS_PACKAGE_PATH", "").split(":"))
    return [*map(Path, package_dirs), *above, *map(Path, ros)]


def _add_visuals(
    tree: Tree, root: ET.Element, links: Mapping[str, Any], folders: list[Path]
) -> None:
    """Add what is drawn; colours may be given once for all links, some at their first use."""
    colours: dict[str, list[float]] = {}
    for material in root.iter("material"):
        with suppress(ValueError):
            colours[material.get("name", "")] = _rgba(material)
    for link in root.findall("link"):
        frame = links[link.get("name", "")]
        for visual in link.findall("visual"):
            try:
                pose = frame.placement * _pose(visual.find("origin"))
                tree.shapes.append({
                    "joint": int(frame.parentJoint) - 1, "placement": rows_of(pose),
                    **_solid(visual, colours, folders),
                })  # fmt: skip
            except ValueError:
                said = "a visual without one shape of known size is not drawn"
                tree.remark(link.get("name", ""), said)


def _solid(visual: ET.Element, colours: Mapping[str, list[float]], folders: list[Path]) -> Row:
    """Return the shape of a visual; raises ValueError where it has not one of known size."""
    (solid,) = visual.findall("geometry/*")
    mesh = solid.tag == "mesh"
    if solid.tag not in _LENGTHS:
        raise ValueError(solid.tag)
    texts = [solid.get(key, "1 1 1" if mesh else "") for key in _LENGTHS[solid.tag]]
    size = [x for text in texts for x in _numbers(text, SIZES[solid.tag] // len(texts))]
    if not mesh and min(size) <= 0.0:
        raise ValueError(size)
    material, colour = visual.find("material"), list(GREY)
    if material is not None:
        colour = colours.get(material.get("name", ""), colour)
        with suppress(ValueError):
            colour = _rgba(material)
    path = _find(solid.get("filename", ""), folders) if mesh else ""
    return {"kind": solid.tag, "size": size, "colour": colour, "path": path}


def _find(address: str, folders: list[Path]) -> str:
    """Resolve ``package://``, ``model://``, ``file://``, absolute and relative addresses.

    What is not found keeps its address.
    """
    scheme, separator, rest = address.partition("://")
    if separator and scheme in ("package", "model"):
        # A package's own folder may be given, whatever it is called on this disk.
        ends = [rest, rest.partition("/")[2]]
    else:
        ends, folders = [rest if separator else address], folders or [Path()]
    for candidate in (folder / end for end in ends for folder in folders):
        # The system has no file of a name that is too long for it, and says so by an error.
        with suppress(OSError, ValueError):
            if candidate.is_file():
                return os.path.abspath(candidate)
    return address


def _pose(origin: ET.Element | None) -> Any:
    """Return the ``pinocchio.SE3`` of an ``<origin>``; None: where its owner is."""
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = (np.array(_numbers(origin.get(key, "0 0 0"), 3)) for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), xyz)


def _rgba(material: ET.Element) -> list[float]:
    colour = material.find("color")
    return _numbers("" if colour is None else colour.get("rgba", ""), 4)


def _numbers(text: str, count: int) -> list[float]:
    """Return the numbers of a text; raises ValueError where they are not so many finite ones."""
    values = [float(word) for word in text.split()]
    if len(values) != count or not all(map(math.isfinite, values)):
        raise ValueError(text)
    return values
