"""An arm as a plain table: joints one behind the other, what each carries, frames and shapes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import solids
from fpid_pin.arms.inertia import inertia_of
from fpid_pin.arms.joints import UNITS, joint_model
from fpid_pin.arms.physical import require_physical
from fpid_pin.arms.solids import placement_of, shaped
from fpid_pin.arms.source import (
    Parts,
    Source,
    given_or_inf,
    gravity_entry,
    gravity_vector,
)
from fpid_pin.arms.urdf_tree import MOST_JOINTS
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, shown

#: Of a frame: Pinocchio's types, by the name that tables have for them.
FRAMES = {
    "link": pin.FrameType.BODY,
    "fixed": pin.FrameType.FIXED_JOINT,
    "frame": pin.FrameType.OP_FRAME,
}
_JOINT = ("name", "kind", "axis", "placement", "inertia")
#: One number of a joint, and the field of an arm that it is; left out: none.
LIMITS = {
    "lower": "lower",
    "upper": "upper",
    "effort": "effort_limit",
    "velocity": "velocity_limit",
}
LOSSES = {"damping": "viscous_friction", "friction": "dry_friction"}
_FRAME = ("name", "joint", "type", "placement")


@dataclass(frozen=True, eq=False)
class ModelSource(Source):
    """A serial chain, written out. It needs no parser, whatever it was read with.

    Parameters
    ----------
    joints
        From the base on. A table each: `name`; `kind`, ``"revolute"`` or ``"prismatic"``; `axis`,
        a unit vector, and `placement`, rows of (3, 4), in the frame of the joint before; `inertia`
        of what it carries, ten numbers as in `fpid_pin.arms.change.Inertias`; and, where there are
        any, `lower`, `upper`, `effort`, `velocity`, `damping`, `friction`, `armature`.
    frames
        A table each: `name`, `joint` (its index, -1 for the base), `type` (``"link"``,
        ``"fixed"``, ``"frame"``) and `placement`.
    shapes
        Rows of `fpid_pin.arms.solids`.
    name
        Of the arm.
    gravity
        (3,) or a number (downwards) [m/s^2].
    home
        (n,); None: the middle of the limits.
    tool
        A frame's name; None: the last.
    """

    joints: Sequence[Mapping[str, Any]]
    frames: Sequence[Mapping[str, Any]] = ()
    shapes: Sequence[Mapping[str, Any]] = ()
    name: str = "arm"
    gravity: ArrayLike = 9.81
    home: ArrayLike | None = None
    tool: str | None = None

    kind: ClassVar[str] = "model"

    def __post_init__(self) -> None:
        checks.instance("name", self.name, str, "a text")
        for name in ("joints", "frames", "shapes"):
            checks.instance(name, getattr(self, name), (list, tuple), "a list of tables")
        n = len(self.joints)
        if not 1 <= n <= MOST_JOINTS:
            raise ArgumentError("joints", f"from 1 to {MOST_JOINTS} joints", f"{n}")
        for k, joint in enumerate(self.joints):
            _require_joint(joint, f"joints.{k}")
        for k, frame in enumerate(self.frames):
            _require_frame(frame, f"frames.{k}", n)
        for k, row in enumerate(self.shapes):
            solids.require_row(row, f"shapes.{k}", n)
        taken = set[str]()
        for name in (str(item["name"]) for item in (*self.joints, *self.frames)):
            if name in taken:
                raise ArgumentError("name", "names of their own", f"{shown(name)} again")
            taken.add(name)
        rows = np.array([joint["inertia"] for joint in self.joints], dtype=np.float64)
        names = [str(joint["name"]) for joint in self.joints]
        # xx, xy, yy, xz, yz, zz: Pinocchio would not make a body of any.
        matrices = rows[:, [4, 5, 7, 5, 6, 8, 7, 8, 9]]
        require_physical(names, rows[:, 0], matrices, cut(self.name))
        if self.home is not None:
            object.__setattr__(self, "home", checks.read_only(shaped("home", self.home, (n,))))
        if self.tool is not None:
            checks.choice("tool", self.tool, [*taken])
        object.__setattr__(self, "gravity", gravity_vector(self.gravity))

    def build(self) -> Parts:
        """Build the model."""
        model = pin.Model()
        model.name = self.name
        model.gravity.linear = np.array(self.gravity)
        for k, joint in enumerate(self.joints):
            axis = np.array(joint["axis"], dtype=np.float64)
            place = placement_of(joint["placement"], "placement")
            at = model.addJoint(k, joint_model(joint["kind"], axis), place, joint["name"])
            model.addJointFrame(at)
            # Set, not appended: appending adds to a zero inertia and rounds.
            model.inertias[at] = inertia_of(np.array(joint["inertia"], dtype=np.float64))
        for frame in self.frames:
            place = placement_of(frame["placement"], "placement")
            at, kind = int(frame["joint"]) + 1, FRAMES[frame["type"]]
            # No inertia of its own: the joints' are whole.
            model.addFrame(pin.Frame(frame["name"], at, place, kind), False)
        model.armature = self._column("armature", 0.0)
        arrays = {field: self._column(key, 0.0) for key, field in LOSSES.items()}
        arrays["lower"], arrays["upper"] = (
            self._column("lower", -np.inf),
            self._column("upper", np.inf),
        )
        for key in ("effort", "velocity"):
            arrays[LIMITS[key]] = given_or_inf(self._column(key, np.inf))
        home = None if self.home is None else np.array(self.home)
        return Parts(model, self.name, home=home, tool=self.tool, **arrays)

    def table(self) -> dict[str, Any]:
        """Return the source as a plain table."""
        table: dict[str, Any] = {
            "name": self.name,
            "gravity": gravity_entry(np.asarray(self.gravity)),
            "joints": [dict(joint) for joint in self.joints],
        }
        for name in ("frames", "shapes"):
            if getattr(self, name):
                table[name] = [dict(row) for row in getattr(self, name)]
        if self.home is not None:
            table["home"] = np.asarray(self.home).tolist()
        return table if self.tool is None else table | {"tool": self.tool}

    def visual(self, model: Any) -> tuple[Any, Any]:
        """Build the shapes; meshes that cannot be read are left out with an `FpidWarning`."""
        return model, solids.geometry_of(self.shapes, cut(self.name))

    def _column(self, key: str, absent: float) -> FloatArray:
        return np.array([joint.get(key, absent) for joint in self.joints], dtype=np.float64)


def _require_joint(joint: Any, name: str) -> None:
    """Refuse, as the argument `name`, what is not a joint's table."""
    _require_keys(joint, name, _JOINT, (*LIMITS, *LOSSES, "armature"))
    checks.choice(f"{name}.kind", joint["kind"], UNITS)
    axis = shaped(f"{name}.axis", joint["axis"], (3,))
    if not abs(np.linalg.norm(axis) - 1.0) < 1e-6:
        raise ArgumentError(f"{name}.axis", "a unit vector", axis.tolist())
    placement_of(joint["placement"], f"{name}.placement")
    shaped(f"{name}.inertia", joint["inertia"], (10,))
    for key in ("effort", "velocity", "armature", *LOSSES):
        if key in joint:
            checks.number(f"{name}.{key}", joint[key], low=0.0)
    bounds = [
        checks.number(f"{name}.{key}", joint[key]) if key in joint else absent
        for key, absent in (("lower", -np.inf), ("upper", np.inf))
    ]
    if not bounds[0] < bounds[1]:
        raise ArgumentError(f"{name}.upper", f"a number > {bounds[0]:g}", f"{bounds[1]:g}")


def _require_frame(frame: Any, name: str, n: int) -> None:
    """Refuse, as the argument `name`, what is not a frame's table, on an arm of `n` joints."""
    _require_keys(frame, name, _FRAME, ())
    checks.integer(f"{name}.joint", frame["joint"], low=-1, high=n - 1)
    checks.choice(f"{name}.type", frame["type"], FRAMES)
    placement_of(frame["placement"], f"{name}.placement")


def _require_keys(table: Any, name: str, required: Sequence[str], optional: Sequence[str]) -> None:
    if not isinstance(table, Mapping):
        raise ArgumentError(name, "a table", shown(table))
    for key in table:
        checks.choice(f"key in {name}", key, (*required, *optional))
    for key in required:
        if key not in table:
            raise ArgumentError(f"{name}.{key}", "a value", "none")
    if not isinstance(table["name"], str) or not table["name"]:
        raise ArgumentError(f"{name}.name", "a name", shown(table["name"]))
