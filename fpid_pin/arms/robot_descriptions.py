"""Arms of robot_descriptions.py, by the names of its modules."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from typing import Any

from fpid_pin import checks
from fpid_pin.arms.robot_file import one_line
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut

_PACKAGE = "robot_descriptions"
#: What the names of its modules end with.
ENDING = "_description"


def described_file(name: str) -> tuple[str, list[str] | None]:
    """Return the file of a description, and the folders of its meshes; of an MJCF file None."""
    module = _module(name)
    if hasattr(module, "URDF_PATH") or hasattr(module, "XACRO_PATH"):
        path = str(getattr(module, "URDF_PATH", None) or _written_out(module, name))
        folders = {str(getattr(module, key)) for key in ("PACKAGE_PATH", "REPOSITORY_PATH")
                   if hasattr(module, key)}  # fmt: skip
        # Meshes are addressed by the package's name, one folder up.
        return path, sorted(folders | {str(Path(folder).parent) for folder in folders})
    if hasattr(module, "MJCF_PATH"):
        return str(module.MJCF_PATH), None
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
    with one_line(f"{name}: cannot be downloaded"):
        return importlib.import_module(f"{_PACKAGE}.{name}")


def _written_out(module: Any, name: str) -> str:
    """Return the URDF that the package's own xacro makes of a description, as its loaders do."""
    with one_line(f"{name}: xacro cannot write it out"):
        return str(importlib.import_module(f"{_PACKAGE}._xacro").get_urdf_path(module))
