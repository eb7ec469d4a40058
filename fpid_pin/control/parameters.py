"""Parameters of laws: checked once, scaled by the arm."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

SCALES = ("none", "inertia")


def joint_scale(scale: str | ArrayLike, arm: Arm) -> FloatArray:
    """Return the factor of the gains on each joint of `arm`, (n,).

    ``"none"``: 1, gains in N m/rad; ``"inertia"``: M_jj at the arm's home, gains in 1/s^2.
    """
    if isinstance(scale, str):
        if checks.choice("scale", scale, SCALES) == "none":
            return np.ones(arm.n)
        return np.diag(arm.mass_matrix(arm.home)).copy()
    return checks.per_joint("scale", scale, arm.n, above=0.0)


def is_number(value: Any) -> bool:
    """Return whether a field holds numbers: a scalar or an array of them (truth is none)."""
    if isinstance(value, (bool, str)):
        return False
    return isinstance(value, (int, float, np.ndarray, np.number)) or (
        isinstance(value, (tuple, list)) and len(value) > 0 and all(is_number(x) for x in value)
    )
