"""Reading an arm from a URDF."""

from __future__ import annotations

import math
import xml.etree.ElementTree as ET
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import visuals
from fpid_pin.arms.source import (
    UNREACHABLE,
    Parts,
    Source,
    gravity_entry,
    gravity_vector,
    limits_of,
    one_line,
)
from fpid_pin.arms.urdf_bare import bare
from fpid_pin.arms.urdf_checks import parse, require_joints
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, shown

_BOUNDS = ("lower", "upper")
_FAR = f"{10.0 * UNREACHABLE:g}"
_NO_LIMIT = {"lower": f"-{_FAR}", "upper": _FAR, "effort": "0", "velocity": "0"}


def unwind(root: ET.Element) -> None:
    """Make continuous joints revolute without limits, so that an angle is one number: nq = nv.

    Limits that are left out or infinite are written as urdfdom takes them: it insists on effort
    and velocity (0: not given) and does not know inf.
    """
    for joint in root.findall("joint"):
        for limit in joint.findall("limit"):
            for name, absent in _NO_LIMIT.items():
                if math.isinf(float(limit.get(name, "0" if name in _BOUNDS else "inf"))):
                    limit.set(name, absent)
        if joint.get("type") != "continuous":
            continue
        joint.set("type", "revolute")
        for limit in joint.findall("limit") or [ET.SubElement(joint, "limit", _NO_LIMIT)]:
            for name in _BOUNDS:
                limit.set(name, _NO_LIMIT[name])


def distinct_frames(model: Any) -> None:
    """Rename links that share their name with a joint: Pinocchio cannot tell such frames apart."""
    joints = {str(frame.name) for frame in model.frames if frame.type != pin.FrameType.BODY}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.name in joints:
            frame.name = f"{frame.name}_link"


@dataclass(frozen=True, eq=False)
class UrdfSource(Source):
    """An arm written as a URDF.

    Parameters
    ----------
    text
        The URDF itself; a saved run holds it whole, and can be rebuilt without the file.
    path
        Where it was read from, to find meshes; None if nowhere.
    lock
        Joints to hold still, and at which value [rad] or [m].
    gravity
        (3,) or a number (downwards) [m/s^2].
    package_dirs
        Folders in which ``package://`` addresses are looked up, besides the file's own and those
        above it.
    """

    text: str
    path: str | None = None
    lock: Mapping[str, float] = field(default_factory=dict)
    gravity: ArrayLike = 9.81
    package_dirs: Sequence[str] = ()

    kind: ClassVar[str] = "urdf"

    def __post_init__(self) -> None:
        checks.instance("urdf", self.text, str, "the text of a URDF")
        if self.path is not None and (not isinstance(self.path, str) or "\0" in self.path):
            raise ArgumentError("path", "the path of a URDF file", shown(self.path))
        if not isinstance(self.lock, Mapping):
            raise ArgumentError("lock", "a table {joint: value}", shown(self.lock))
        held = {str(name): checks.number(f"lock.{name}", x) for name, x in self.lock.items()}
        dirs = self.package_dirs
        checks.instance("package_dirs", dirs, (str, Path, Sequence), "a list of folders")
        listed = (dirs,) if isinstance(dirs, (str, Path)) else tuple(dirs)
        object.__setattr__(self, "lock", held)
        object.__setattr__(self, "gravity", gravity_vector(self.gravity))
        object.__setattr__(self, "package_dirs", tuple(str(folder) for folder in listed))

    @property
    def label(self) -> str:
        """What to call it in an error: its file, else the robot."""
        return cut(self.path or "URDF")

    def build(self) -> Parts:
        """Build the model; limits, friction and rotor inertia are those of the file."""
        full = self.full_model()
        distinct_frames(full)
        model = full
        held = [full.getJointId(name) for name in self.lock]
        if held:
            with one_line(self.label, "its joints cannot be locked"):
                model = pin.buildReducedModel(full, held, self.pose(full))
        model.gravity.linear = np.array(self.gravity)
        tool = "tool" if model.existFrame("tool") else None
        return Parts(model, str(model.name) or "arm", tool=tool, **limits_of(model))

    def full_model(self) -> Any:
        """Build the model with the locked joints still free."""
        text = ET.tostring(bare(self.checked()), encoding="unicode")
        with one_line(self.label, "Pinocchio cannot build it"):
            return pin.buildModelFromXML(text)

    def checked(self) -> ET.Element:
        """Return the URDF, checked, with its continuous joints unwound."""
        root = parse(self.text, self.label)
        require_joints(root, self.label, self.lock)
        unwind(root)
        return root

    def pose(self, full: Any) -> FloatArray:
        """Return the pose of the full model at which joints are locked, (nq,)."""
        q = np.zeros(full.nq)
        for name, value in self.lock.items():
            q[full.joints[full.getJointId(name)].idx_q] = value
        return q

    def table(self) -> dict[str, Any]:
        """Return the URDF's text, its path, locks and gravity."""
        table: dict[str, Any] = {
            "urdf": self.text,
            "gravity": gravity_entry(np.asarray(self.gravity)),
        }
        if self.path is not None:
            table["path"] = self.path
        if self.lock:
            table["lock"] = dict(self.lock)
        if self.package_dirs:
            table["package_dirs"] = list(self.package_dirs)
        return table

    def visual(self, model: Any) -> tuple[Any, Any]:
        """Load the visuals; meshes that cannot be found are left out with an `FpidWarning`."""
        full = self.full_model()
        folder = None if self.path is None else Path(self.path).resolve().parent
        geometry = visuals.load(full, self.checked(), self.label, folder, self.package_dirs)
        held = [full.getJointId(name) for name in self.lock]
        if held:
            distinct_frames(full)
            _, (geometry,) = pin.buildReducedModel(full, [geometry], held, self.pose(full))
        return model, geometry
