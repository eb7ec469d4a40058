"""Reading an arm from MuJoCo's MJCF, by Pinocchio's parser."""

from __future__ import annotations

import warnings
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin.arms.mjcf_base import put_base, require_one_base
from fpid_pin.arms.mjcf_limits import mend_limits
from fpid_pin.arms.model import ModelSource
from fpid_pin.arms.physical import require_physical
from fpid_pin.arms.pinocchio_model import source_of
from fpid_pin.arms.source import one_line
from fpid_pin.arms.urdf_bare import numbers
from fpid_pin.arms.xml_text import parse_xml, read_text, require_root
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArmError, FpidWarning
from fpid_pin.text import cut, named

#: Elements that stand for others; Pinocchio's parser would pass them over in silence.
_UNWRITTEN = ("include", "frame", "replicate", "attach", "composite", "flexcomp")
#: Settings of the compiler that change masses or limits, which the parser does not do (Pinocchio
#: 4.1); and what they are where they change nothing.
_COMPILER = (
    "settotalmass", "boundmass", "boundinertia", "balanceinertia", "inertiagrouprange",
    "inertiafromgeom", "autolimits", "coordinate",
)  # fmt: skip
_NOTHING = {"inertiafromgeom": ("auto", "false"), "autolimits": ("true",)}
_Counts = dict[str, tuple[int, ...]]
_PLACE: _Counts = {
    "pos": (3,),
    "quat": (4,),
    "euler": (3,),
    "axisangle": (4,),
    "xyaxes": (6,),
    "zaxis": (3,),
}
#: Attributes that are numbers, and how many; the parser would take what memory holds for others.
_NUMBERS: dict[str, _Counts] = {
    "option": {"gravity": (3,)},
    "body": _PLACE,
    "geom": _PLACE
    | {"size": (1, 2, 3), "fromto": (6,), "mass": (1,), "density": (1,), "rgba": (4,)},
    "site": _PLACE,
    "inertial": _PLACE | {"mass": (1,), "diaginertia": (3,), "fullinertia": (6,)},
    "joint": {
        "axis": (3,), "pos": (3,), "range": (2,), "actuatorfrcrange": (2,), "damping": (1,),
        "frictionloss": (1,), "armature": (1,), "stiffness": (1,), "ref": (1,),
    },
}  # fmt: skip
_NEVER_NEGATIVE = ("damping", "frictionloss", "armature", "density")
_FULL = (0, 3, 4, 3, 1, 5, 4, 5, 2)


def read_mjcf(
    path: str | Path, lock: Mapping[str, float] | None, gravity: ArrayLike | None
) -> ModelSource:
    """Read an MJCF file; see `Arm.from_mjcf`."""
    label = cut(str(path))
    root = parse_xml(read_text(path, "MJCF"), label)
    require_root(root, "mujoco", label)
    _require_written_out(root, label)
    require_one_base(root, label)
    _require_numbers(root, label)
    _require_inertias(root, label)
    with one_line(label, "Pinocchio cannot build it"):
        model = pin.buildModelFromMJCF(str(path))
    mend_limits(model, root)
    geometry = _geometry(model, path, label)
    put_base(model, geometry, root, label)
    option = root.find("option")
    if gravity is None:
        # The parser leaves its own.
        given = None if option is None else option.get("gravity")
        gravity = (0.0, 0.0, -9.81) if given is None else np.array(numbers(given))
    source = source_of(model, label=label, lock=lock, gravity=gravity, geometry=geometry)
    _say_what_is_left_out(root, label)
    return source


def _require_written_out(root: ET.Element, label: str) -> None:
    for element in root.iter():
        if element.tag in _UNWRITTEN:
            raise ArmError(
                f"{label}: expected a model that is written out, got <{element.tag}> (MuJoCo's "
                "mj_saveLastXML writes one)"
            )
    for compiler in root.findall("compiler"):
        for key in _COMPILER:
            value = compiler.get(key)
            if value not in (None, *_NOTHING.get(key, ("false", "0", "-1", "local"))):
                raise ArmError(
                    f"{label}: <compiler>: expected no {key}, which is not done here, got "
                    f"{named(value)}"
                )


def _require_numbers(root: ET.Element, label: str) -> None:
    for element in root.iter():
        for key, counts in _NUMBERS.get(str(element.tag), {}).items():
            text = element.get(key)
            if text is None:
                continue
            values = numbers(text) or []
            where = f"{label}: {element.tag} {named(element.get('name', ''))}"
            if len(values) not in counts or not np.isfinite(values).all():
                count = " or ".join(map(str, counts))
                raise ArmError(f"{where}: expected {count} number(s) in {key}, got {named(text)}")
            if key in _NEVER_NEGATIVE and values[0] < 0.0:
                raise ArmError(f"{where}: expected {key} >= 0, got {values[0]:g}")
            if key == "ref" and values[0] != 0.0:
                raise ArmError(
                    f"{where}: expected angles from the drawn pose on, got ref {named(text)}"
                )
            if key == "axis" and not np.linalg.norm(values) > 1e-9:
                raise ArmError(f"{where}: expected a direction in axis, got {named(text)}")


def _require_inertias(root: ET.Element, label: str) -> None:
    """Refuse what no body is, and bodies whose mass the parser would make up."""
    names, masses, matrices = [], [], list[FloatArray]()
    moving = {
        below
        for body in root.iter("body")
        if body.find("joint") is not None
        for below in body.iter("body")
    }
    shared = any(geom.get("mass") for part in root.iter("default") for geom in part.iter("geom"))
    for body in root.iter("body"):
        name, inertial = body.get("name", ""), body.find("inertial")
        if inertial is not None:
            names.append(name)
            masses.append((numbers(inertial.get("mass", "")) or [0.0])[0])
            matrices.append(_matrix(inertial))
        elif body not in moving:
            # Held by the world: nothing feels its weight.
            continue
        elif any(g.get("mesh") or g.get("type") == "mesh" for g in body.findall("geom")):
            # Of a mesh that it does not find it takes 1 kg and 1 kg m^2.
            raise ArmError(
                f"{label}: body {named(name)}: expected an <inertial>, got meshes alone (MuJoCo's "
                "compiler knows it: body_mass, body_ipos, body_iquat, body_inertia)"
            )
        elif shared and body.find("geom") is not None:
            # The parser does not look there.
            raise ArmError(
                f"{label}: body {named(name)}: expected an <inertial> or the mass of each <geom>, "
                "got a mass in <default>"
            )
    require_physical(names, masses, matrices, label)


def _matrix(inertial: ET.Element) -> FloatArray:
    full = inertial.get("fullinertia")
    if full is not None:
        return np.array(numbers(full))[list(_FULL)].reshape(3, 3)
    return np.diag(numbers(inertial.get("diaginertia", "0 0 0")) or [0.0] * 3)


def _geometry(model: Any, path: str | Path, label: str) -> Any:
    try:
        with one_line(label, "its visuals cannot be loaded"):
            return pin.buildGeomFromMJCF(model, str(path), pin.GeometryType.VISUAL)
    except ArmError as error:
        warnings.warn(f"{error}; drawn from primitives instead", FpidWarning, stacklevel=5)
        return None


def _say_what_is_left_out(root: ET.Element, label: str) -> None:
    """Warn of what pulls at the joints in MuJoCo and is not part of an arm here."""
    springs = sum(
        (numbers(joint.get("stiffness", "0")) or [0.0])[0] != 0.0 for joint in root.iter("joint")
    )
    counts = {
        "spring(s)": springs,
        "equality constraint(s)": sum(len(part) for part in root.findall("equality")),
        "tendon(s)": sum(len(part) for part in root.findall("tendon")),
    }
    found = ", ".join(f"{count} {name}" for name, count in counts.items() if count)
    if found:
        warnings.warn(f"{label}: left out: {found}", FpidWarning, stacklevel=5)
