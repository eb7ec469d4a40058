"""Parameters of laws on an arm, and the gains of the disturbance observer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray

#: Largest bandwidth of an observer, times the step. There what it estimates, once cancelled, still
#: bears two samples of delay that nobody told it of, or a model 5.7 times too heavy; from 1.4 on
#: two samples make it unstable. The noise of xi is 0.44 sigma/step there where that of speeds is
#: sigma, and 0.016 at 0.1.
FASTEST = 1.0


def rows_on(name: str, value: ArrayLike, rows: int, n: int) -> FloatArray:
    """Return numbers that a description has checked, a scalar, (n,) or (rows, n), as (rows, n)."""
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and array.shape not in ((n,), (rows, n)):
        raise checks.ArgumentError(name, f"shape ({n},) or ({rows}, {n})", f"shape {array.shape}")
    return np.broadcast_to(array, (rows, n))


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
