"""Whether the links of a URDF could be bodies."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin.exceptions import ArmError
from fpid_pin.text import named

#: Part of the largest principal moment by which the others may fall short: files are rounded, some
#: to three digits.
_ROUNDING = 1e-2
_ENTRIES = ("ixx", "ixy", "ixz", "ixy", "iyy", "iyz", "ixz", "iyz", "izz")


def require_bodies(root: ET.Element, label: str) -> None:
    """Refuse masses and inertias that no body has.

    A mass is not negative. Neither are the principal moments of inertia, and none is larger than
    the sum of the other two: Ixx + Iyy - Izz is twice an integral of z^2. A thousand links are
    judged in one go. The file's numbers have been checked to be numbers.

    Raises
    ------
    ArmError
        Naming the first link at fault.
    """
    names, masses, matrices = _inertias(root)
    if not names:
        return
    light = masses < 0.0
    if light.any():
        k = int(np.argmax(light))
        raise ArmError(
            f"{label}: link {named(names[k])}: expected a mass >= 0 [kg], got {masses[k]:g}"
        )
    # To one scale: the largest doubles would overflow on the way to their eigenvalues.
    sizes = np.abs(matrices).max(axis=(1, 2))
    moments = np.linalg.eigvalsh(matrices / np.where(sizes > 0.0, sizes, 1.0)[:, None, None])
    low, middle, high = moments.T
    bad = np.minimum(low, low + middle - high) < -_ROUNDING * high
    # Rounding makes no sign.
    bad |= (np.diagonal(matrices, axis1=1, axis2=2) < 0.0).any(axis=1)
    if bad.any():
        k = int(np.argmax(bad))
        got = ", ".join(f"{float(sizes[k]) * moment:.4g}" for moment in moments[k].tolist())
        raise ArmError(
            f"{label}: link {named(names[k])}: expected principal moments of inertia >= 0 [kg m^2] "
            f"with none above the sum of the others, got {got}"
        )


def _inertias(root: ET.Element) -> tuple[list[str], NDArray[Any], NDArray[Any]]:
    """Return names, masses (L,) and inertias (L, 3, 3) of the links that have any."""
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
    return names, np.array(masses), np.array(rows).reshape(-1, 3, 3)
