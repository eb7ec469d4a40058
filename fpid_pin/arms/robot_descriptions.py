"""Arms of robot_descriptions.py, by the names of its modules."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.mjcf import read_mjcf
from fpid_pin.arms.source import Source
from fpid_pin.arms.urdf import UrdfSource
from fpid_pin.arms.xml_text import read_text
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut, visible

_PACKAGE = "robot_descriptions"
#: What the names of its modules end with.
ENDING = "_description"


def read_description(
    name: str, lock: Mapping[str, float] | None, gravity: ArrayLike | None
) -> Source:
    """Read an arm of robot_descriptions; see `Arm.from_description`."""
    module = _module(name)
    if hasattr(module, "URDF_PATH") or hasattr(module, "XACRO_PATH"):
        path = str(getattr(module, "URDF_PATH", None) or _written_out(module, name))
        folders = {str(getattr(module, key)) for key in ("PACKAGE_PATH", "REPOSITORY_PATH")
                   if hasattr(module, key)}  # fmt: skip
        # Meshes are addressed by the package's name, one folder up.
        folders |= {str(Path(folder).parent) for folder in folders}
        given = 9.81 if gravity is None else gravity
        return UrdfSource(read_text(path), path, lock or {}, given, tuple(sorted(folders)))
    if hasattr(module, "MJCF_PATH"):
        return read_mjcf(str(module.MJCF_PATH), lock, gravity)
    raise ArmError(f"{name}: expected a description with a URDF or an MJCF file, got neither")


def _module(name: Any) -> Any:
    """Import the module of a description, which downloads the robot the first time."""
    try:
        package = importlib.import_module(_PACKAGE)
    except ImportError:
        raise ArmError(
            f"{cut(str(name))}: expected the package robot_descriptions, got none "
            "(pip install fpid_pin[descriptions])"
        ) from None
    known = [
        item.name
        for item in pkgutil.iter_modules(package.__path__)
        if item.name.endswith(ENDING) and not item.name.startswith("_")
    ]
    checks.choice("description", name, known)
    with _told(f"{name}: cannot be downloaded"):
        return importlib.import_module(f"{_PACKAGE}.{name}")


def _written_out(module: Any, name: str) -> str:
    """Return the URDF that the package's own xacro makes of a description, as its loaders do."""
    with _told(f"{name}: xacro cannot write it out"):
        return str(importlib.import_module(f"{_PACKAGE}._xacro").get_urdf_path(module))


@contextmanager
def _told(what: str) -> Iterator[None]:
    """Turn whatever comes of it into one line: git, network, disk, xacro each raise their own."""
    try:
        yield
    except Exception as error:
        reason = visible(" ".join(str(error).split())) or type(error).__name__
        raise ArmError(f"{what}: {cut(reason)}") from None
