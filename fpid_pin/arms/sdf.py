"""Reading an arm from SDF, where Pinocchio was built with its parser."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin.arms.model import ModelSource
from fpid_pin.arms.pinocchio_model import source_of
from fpid_pin.arms.source import one_line
from fpid_pin.arms.urdf_bare import numbers
from fpid_pin.arms.xml_text import parse_xml, read_text, require_root
from fpid_pin.exceptions import ArmError
from fpid_pin.text import cut


def read_sdf(
    path: str | Path, lock: Mapping[str, float] | None, gravity: ArrayLike | None
) -> ModelSource:
    """Read an SDF file; see `Arm.from_sdf`."""
    label = cut(str(path))
    root = parse_xml(read_text(path, "SDF"), label)
    require_root(root, "sdf", label)
    if not pin.WITH_SDFORMAT:
        raise ArmError(
            f"{label}: expected a Pinocchio that reads SDF, got one built without "
            "sdformat, as the wheel is (write the robot as a URDF or MJCF)"
        )
    with one_line(label, "Pinocchio cannot build it"):
        model, _, geometry = pin.buildModelsFromSdf(
            str(path), geometry_types=pin.GeometryType.VISUAL
        )
    if gravity is None:
        given = root.findtext("world/gravity")
        gravity = np.array((0.0, 0.0, -9.81) if given is None else numbers(given))
    return source_of(model, label=label, lock=lock, gravity=gravity, geometry=geometry)
