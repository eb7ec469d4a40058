"""What references through points have in common: the points, checked, and splines that hold."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references.reference import Motion

#: A spline of scipy for the angles, and its first two derivatives.
Splines = tuple[Any, Any, Any]


def check_rows(name: str, value: ArrayLike) -> FloatArray:
    """Check positions, (K, n); an error names the first row of another length."""
    if isinstance(value, (list, tuple)) and len({np.size(row) for row in value}) > 1:
        sizes = [int(np.size(row)) for row in value]
        odd = next(k for k, size in enumerate(sizes) if size != sizes[0])
        raise ArgumentError(
            f"{name}.{odd}", f"{sizes[0]} angles, as in the first row", f"{sizes[odd]}"
        )
    return checks.floats(name, value, shape=(None, None))


def Rows(unit: str) -> checks.Check:
    """Declare positions, (K, n)."""
    return checks.Check(check_rows, unit)


def check_points(t: FloatArray, q: FloatArray) -> None:
    """Check that times, (K,), increase, and that positions, (K, n), have a row for each."""
    if len(t) < 2:
        raise ArgumentError("reference.times", "at least two times", f"shape {t.shape}")
    if len(q) != len(t):
        raise ArgumentError(
            "reference.positions", f"shape ({len(t)}, n), a row for each time", f"shape {q.shape}"
        )
    backward = np.flatnonzero(np.diff(t) <= 0.0)
    if backward.size:
        k = int(backward[0]) + 1
        raise ArgumentError(
            f"reference.times.{k}", f"a time after the one before ({t[k - 1]:g} s)", f"{t[k]:g} s"
        )


def with_derivatives(spline: Any) -> Splines:
    """Return a spline and its first two derivatives."""
    return spline, spline.derivative(1), spline.derivative(2)


def held(t: FloatArray, times: FloatArray, splines: Splines) -> Motion:
    """Sample splines within `times`; beyond them the ends hold, at rest."""
    inside = np.clip(t, times[0], times[-1])
    q, v, a = (np.array(spline(inside), dtype=np.float64) for spline in splines)
    # A sample may fall a rounding error beside the instant it stands for.
    slack = 1e-9
    outside = (t < times[0] - slack) | (t > times[-1] + slack)
    v[outside] = 0.0
    a[outside] = 0.0
    return q, v, a
