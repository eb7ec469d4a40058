"""Limits that an MJCF file gives and Pinocchio's parser passes over, or takes for others."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from typing import Any

import numpy as np

from fpid_pin.arms.joints import PRISMATIC, kind_of
from fpid_pin.arms.urdf_bare import numbers


def mend_limits(model: Any, root: ET.Element) -> None:
    """Set a model's limits to those of its MJCF file.

    Seen of Pinocchio 4.1: the range of a slide is taken for degrees where angles are, one that is
    switched off (``limited="false"``) is kept, and actuators are not read. The most that an
    actuator gives is its ``forcerange``, or a motor's ``ctrlrange``, times its gear.
    """
    compiler = root.find("compiler")
    degrees = compiler is None or compiler.get("angle", "degree") != "radian"
    unlimited = {j.get("name") for j in root.iter("joint") if j.get("limited") == "false"}
    forces = dict(_forces(root))
    lower, upper = np.array(model.lowerPositionLimit), np.array(model.upperPositionLimit)
    effort = np.array(model.upperEffortLimit)
    for k in range(1, model.njoints):
        joint, name = model.joints[k], str(model.names[k])
        if joint.nq != 1:
            continue
        at = joint.idx_q
        if name in unlimited:
            lower[at], upper[at] = -np.inf, np.inf
        elif kind_of(joint) == PRISMATIC and degrees:
            # Twelve digits: turned into radians and back, a number is no longer quite itself.
            for bound in (lower, upper):
                bound[at] = float(f"{np.degrees(bound[at]):.12g}")
        if name in forces:
            effort[joint.idx_v] = min(effort[joint.idx_v], forces[name])
    model.lowerPositionLimit, model.upperPositionLimit = lower, upper
    model.lowerEffortLimit, model.upperEffortLimit = -effort, effort


def _forces(root: ET.Element) -> Iterator[tuple[str, float]]:
    """Yield joints' names, and the most that their actuator gives [N m] or [N]."""
    above = {child: parent for parent in root.iter("default") for child in parent}
    classes = {part.get("class", ""): part for part in root.iter("default")}
    main = root.find("default")
    for part in root.findall("actuator/*"):
        place = classes.get(part.get("class", ""), main)

        def value(key: str, part: Any = part, place: Any = place) -> str | None:
            found, at = part.get(key), place
            while found is None and at is not None:
                own = at.find(part.tag)
                found = None if own is None else own.get(key)
                at = above.get(at)
            return found if found is None else str(found)

        span = value("forcerange") or (value("ctrlrange") if part.tag == "motor" else None)
        gear = numbers(value("gear") or "1") or [1.0]
        bounds = numbers(span or "") or [0.0]
        most = abs(gear[0]) * max(map(abs, bounds))
        if most > 0.0:
            yield part.get("joint", ""), most
