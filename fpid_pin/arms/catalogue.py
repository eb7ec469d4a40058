"""Arms by name: of example-robot-data those that work, of robot_descriptions by its modules."""

import importlib
import pkgutil
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from fpid_pin import checks
from fpid_pin.arms.robot_file import one_line
from fpid_pin.arms.tree import Tree
from fpid_pin.arms.urdf import urdf_tree
from fpid_pin.exceptions import ArmError
from fpid_pin.resources import needed


@dataclass(frozen=True)
class Entry:
    """One arm of the catalogue, a table of ``catalogue.toml``."""

    file: str  # below example-robot-data's folder of robots
    credit: str  # where the description comes from and its licence, as the data package has them
    #: The data package's reference posture as angles, moved into the limits by whole turns; empty:
    #: the middle of the limits.
    home: Sequence[float] = ()
    lock: Mapping[str, float] = field(default_factory=dict)  # joints that are no part of the arm
    armature: Sequence[float] = ()  # rotor inertia that the file does not carry [kg m^2]
    tool: str | None = None  # where the last link of the file is not it
    note: str = ""  # what a user should know


ENTRIES = {
    name: Entry(**fields)
    for name, fields in tomllib.loads(
        (resources.files("fpid_pin.arms") / "catalogue.toml").read_text(encoding="utf-8")
    ).items()
}


def names() -> tuple[str, ...]:
    """Return the names that `Arm.from_example` knows, sorted."""
    return tuple(sorted(ENTRIES))


def example_tree(name: str) -> tuple[Tree, Mapping[str, float]]:
    """Return an arm of the catalogue before its joints are held, and those that the entry holds."""
    entry = ENTRIES[checks.choice("name", name, names())]
    # Heavy (it loads half a dozen packages' worth of paths), hence not at import.
    from example_robot_data.robots_loader import getModelPath

    try:
        folder = Path(getModelPath(entry.file)).resolve()
    except OSError:
        raise ArmError(
            f"{name}: expected example-robot-data to hold {entry.file}, got none "
            "(pip install example-robot-data)"
        ) from None
    path = folder / entry.file
    # Meshes are addressed as package://example-robot-data/robots/..., two folders up.
    tree = urdf_tree(path, package_dirs=(folder.parent.parent,))
    tree.name, tree.tool = name, entry.tool
    tree.credit = f"{name}: {entry.credit} (by way of example-robot-data)"
    # The catalogue's arrays are for the arm with the catalogue's own locks.
    own = [joint for joint in tree.joints if joint["name"] not in entry.lock]
    tree.home = {joint["name"]: q for joint, q in zip(own, entry.home, strict=False)}
    for joint, armature in zip(own, entry.armature, strict=False):
        joint["armature"] = armature
    return tree, entry.lock


# ---------------------------------------------------------------------- robot_descriptions

_PACKAGE = "robot_descriptions"
#: What the names of its modules end with.
ENDING = "_description"


def described_file(name: str) -> tuple[str, dict[str, Any]]:
    """Return the file of a description, and where its meshes are as `Arm.from_file` takes it.

    Its module is imported, which downloads the robot the first time.
    """
    checks.choice("description", name, _modules(needed(_PACKAGE, "descriptions")))
    with one_line(f"{name}: cannot be downloaded"):
        module = importlib.import_module(f"{_PACKAGE}.{name}")
    urdf = getattr(module, "URDF_PATH", None)
    if urdf is None and hasattr(module, "XACRO_PATH"):
        with one_line(f"{name}: xacro cannot write it out"):
            urdf = importlib.import_module(f"{_PACKAGE}._xacro").get_urdf_path(module)
    if urdf is not None:
        folders = {str(getattr(module, key)) for key in ("PACKAGE_PATH", "REPOSITORY_PATH")
                   if hasattr(module, key)}  # fmt: skip
        # Meshes are addressed by the package's name, one folder up.
        above = {str(Path(folder).parent) for folder in folders}
        return str(urdf), {"package_dirs": sorted(folders | above)}
    if hasattr(module, "MJCF_PATH"):
        return str(module.MJCF_PATH), {}
    raise ArmError(f"{name}: expected a description with a URDF or an MJCF file, got neither")


def descriptions() -> list[str]:
    """Return the names that `Arm.from_description` knows; none where the package is missing."""
    try:
        return _modules(importlib.import_module(_PACKAGE))
    except ImportError:
        return []


def _modules(package: Any) -> list[str]:
    names = (item.name for item in pkgutil.iter_modules(package.__path__))
    return [name for name in names if name.endswith(ENDING) and not name.startswith("_")]
