"""Parameters of laws: checked once, scaled by the arm, stacked to (runs, n)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

SCALES = ("none", "inertia")


def check_gains(description: Any, *names: str, above: float | None = None) -> None:
    """Replace the named fields of a frozen description by checked read-only arrays.

    Each is a scalar or (n,); at least 0, or more than `above`. All (n,) must have one length.

    Raises
    ------
    ArgumentError
        A negative gain, or lengths that differ.
    """
    low = 0.0 if above is None else None
    for name in names:
        value = getattr(description, name)
        array = checks.floats(name, value, low=low, above=above, max_ndim=1)
        object.__setattr__(description, name, array)
    lengths = {
        name: len(value)
        for name, value in vars(description).items()
        if isinstance(value, np.ndarray) and value.ndim
    }
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} ({length},)" for name, length in lengths.items())
        raise checks.ArgumentError("gains", "one length for all joints", listed)


def check_scale(description: Any) -> None:
    """Check the field ``scale`` of a description: one of `SCALES`, a scalar or (n,)."""
    scale = description.scale
    if isinstance(scale, str):
        checks.choice("scale", scale, SCALES)
    else:
        check_gains(description, "scale", above=0.0)


def joint_scale(scale: str | ArrayLike, arm: Arm) -> FloatArray:
    """Return the factor of the gains on each joint of `arm`, (n,).

    ``"none"``: 1, gains in N m/rad; ``"inertia"``: M_jj at the arm's home, gains in 1/s^2.
    """
    if isinstance(scale, str):
        if scale == "none":
            return np.ones(arm.n)
        return np.diag(arm.mass_matrix(arm.home)).copy()
    return checks.per_joint("scale", scale, arm.n, above=0.0)


def stacked(controllers: Sequence[Any], name: str, arm: Arm, *, scaled: bool = False) -> FloatArray:
    """Return one parameter of all controllers, (runs, n); times their scale if `scaled`."""
    rows = [checks.per_joint(name, getattr(c, name), arm.n) for c in controllers]
    if scaled:
        rows = [row * joint_scale(c.scale, arm) for row, c in zip(rows, controllers, strict=True)]
    return np.array(rows)
