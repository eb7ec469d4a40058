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


def check_points(times: ArrayLike, positions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Check times, (K,), that increase, and positions, (K, n), one row for each."""
    t = checks.floats("reference.times", times, max_ndim=1)
    try:
        q = checks.floats("reference.positions", positions, max_ndim=2)
    except ArgumentError as error:
        if isinstance(positions, (list, tuple)) and len({np.size(row) for row in positions}) > 1:
            sizes = [int(np.size(row)) for row in positions]
            odd = next(k for k, size in enumerate(sizes) if size != sizes[0])
            raise ArgumentError(
                f"reference.positions.{odd}", f"{sizes[0]} angles, as in the first row",
                f"{sizes[odd]}",
            ) from None  # fmt: skip
        raise error
    if t.ndim != 1 or len(t) < 2:
        raise ArgumentError("reference.times", "at least two times", f"shape {t.shape}")
    if q.ndim != 2 or len(q) != len(t):
        raise ArgumentError(
            "reference.positions", f"shape ({len(t)}, n), a row for each time", f"shape {q.shape}"
        )
    backward = np.flatnonzero(np.diff(t) <= 0.0)
    if backward.size:
        k = int(backward[0]) + 1
        raise ArgumentError(
            f"reference.times.{k}", f"a time after the one before ({t[k - 1]:g} s)", f"{t[k]:g} s"
        )
    return t, q


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
