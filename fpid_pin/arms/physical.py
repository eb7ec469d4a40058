"""Whether masses and inertias could be those of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin.exceptions import ArmError
from fpid_pin.text import named

#: Part of the largest principal moment by which the others may fall short: files are rounded, some
#: to three digits.
_ROUNDING = 1e-2


def require_physical(
    names: Sequence[str], masses: ArrayLike, inertias: ArrayLike, label: str
) -> None:
    """Refuse masses and inertias that no body has.

    A mass is not negative. Neither are the principal moments of inertia, and none is larger than
    the sum of the other two: Ixx + Iyy - Izz is twice an integral of z^2. A thousand links are
    judged in one go.

    Parameters
    ----------
    names
        Of the links.
    masses, inertias
        (L,) [kg] and (L, 3, 3) about the centres of mass [kg m^2].
    label
        What to call the arm.

    Raises
    ------
    ArmError
        Naming the first link at fault.
    """
    if not names:
        return
    mass: NDArray[Any] = np.asarray(masses, dtype=np.float64)
    matrices: NDArray[Any] = np.asarray(inertias, dtype=np.float64).reshape(-1, 3, 3)
    for bad in (~np.isfinite(mass), ~np.isfinite(matrices).all(axis=(1, 2))):
        if bad.any():
            raise ArmError(
                f"{label}: link {named(names[int(np.argmax(bad))])}: expected a finite mass and "
                "inertia, got NaN or inf"
            )
    light = mass < 0.0
    if light.any():
        k = int(np.argmax(light))
        raise ArmError(
            f"{label}: link {named(names[k])}: expected a mass >= 0 [kg], got {mass[k]:g}"
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
