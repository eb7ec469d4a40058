"""Parameters of laws: checked once, scaled by the arm."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

SCALES = ("none", "inertia")
#: Largest bandwidth of an observer, times the step. There what it estimates, once cancelled, still
#: bears two samples of delay that nobody told it of, or a model 5.7 times too heavy; from 1.4 on
#: two samples make it unstable. The noise of xi is 0.44 sigma/step there where that of speeds is
#: sigma, and 0.016 at 0.1.
FASTEST = 1.0


def check_gains(
    description: Any,
    *names: str,
    low: float | None = 0.0,
    high: float | None = None,
    above: float | None = None,
    what: str = "gains",
) -> None:
    """Replace the named fields of a frozen description by checked read-only arrays.

    Each is a scalar or (n,), within its bounds. All (n,) must have one length.

    Raises
    ------
    ArgumentError
        A number out of bounds, or lengths that differ.
    """
    for name in names:
        value = getattr(description, name)
        array = checks.floats(
            name, value, low=None if above is not None else low, high=high, above=above, max_ndim=1
        )
        object.__setattr__(description, name, array)
    check_lengths(description, what)


def check_lengths(description: Any, what: str = "gains") -> None:
    """Check that all arrays of a description have one length, (n,) or (..., n)."""
    lengths = {
        name: value.shape[-1]
        for name, value in vars(description).items()
        if isinstance(value, np.ndarray) and value.ndim
    }
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{name} ({length},)" for name, length in lengths.items())
        raise checks.ArgumentError(what, "one length for all joints", listed)


def check_scale(description: Any) -> None:
    """Check the field ``scale`` of a description: one of `SCALES`, a scalar or (n,)."""
    if isinstance(description.scale, str):
        checks.choice("scale", description.scale, SCALES)
    else:
        check_gains(description, "scale", above=0.0)


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


def observer_gains(bandwidth: float, step: float) -> tuple[float, float]:
    """Return the gains of `kernels.observer`, 1 - p^2 and (1 - p)^2/h; 0 for no bandwidth.

    Raises
    ------
    ArgumentError
        An observer faster than the sampling allows.
    """
    if bandwidth * step > FASTEST + 1e-9:
        expected = f"at most {FASTEST:g}/step ({FASTEST / step:g} rad/s)"
        raise checks.ArgumentError("observer", expected, f"{bandwidth:g} rad/s")
    pole = math.exp(-bandwidth * step)
    return 1.0 - pole**2, (1.0 - pole) ** 2 / step
