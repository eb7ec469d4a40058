"""Whether the links of a URDF could be bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET

from fpid_pin.arms.physical import require_physical

_ENTRIES = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")


def require_bodies(root: ET.Element, label: str) -> None:
    """Refuse links that no body is like; the file's numbers have been checked to be numbers.

    Raises
    ------
    ArmError
        Naming the first link at fault.
    """
    names, masses, rows = [], [], []
    for link in root.findall("link"):
        body = link.find("inertial")
        if body is not None:
            mass, inertia = body.find("mass"), body.find("inertia")
            assert mass is not None
            assert inertia is not None
            names.append(link.get("name", ""))
            masses.append(float(mass.get("value", "")))
            rows.append([float(inertia.get(entry, "")) for entry in _ENTRIES])
    require_physical(names, masses, rows, label)
