"""Exact integrals of a decaying mode over one sampling step.

A mode obeys x' = -p x + f'. Over a step h, with q = p h and theta running back from the newest
sample, the rate is the quadratic through both measured rates whose mean is the measured change:

    x_k = E x_(k-1) + b1 f'_k + b0 f'_(k-1) + b2 m_k
    b1, b0, b2 = h int_0^1 exp(-q theta) {1 - theta, theta, 6 theta (1 - theta)} dtheta
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray

# Below this q the closed forms cancel and the power series converges within its length.
_SERIES_BELOW = 1.0
_SERIES_TERMS = 20


class StepIntegrals(NamedTuple):
    """One step of the modes with decay rates p: E, b1, b0, b2 [s], arrays of the poles' shape."""

    decay: FloatArray
    now: FloatArray
    before: FloatArray
    mean: FloatArray


def integrate_step(poles: FloatArray, step: float) -> StepIntegrals:
    """Integrate modes of decay rates `poles` [1/s] over `step` [s], to rounding error."""
    q = np.asarray(poles, dtype=np.float64) * step
    small = q < _SERIES_BELOW
    near = np.where(small, q, 0.0)
    far = np.where(small, 1.0, q)

    # int exp(-q theta) theta^n: closed forms for large q, integrated by parts.
    e_far = np.exp(-far)
    i0 = -np.expm1(-far) / far
    i1 = (i0 - e_far) / far
    i2 = (2.0 * i1 - e_far) / far

    # The same three as power series, whose terms are combined before they are summed.
    now, before, mean = (np.zeros_like(q) for _ in range(3))
    term = np.ones_like(q)
    for k in range(_SERIES_TERMS):
        now += term / ((k + 1) * (k + 2))
        before += term / (k + 2)
        mean += term * (6.0 / ((k + 2) * (k + 3)))
        term = term * (-near / (k + 1))
    return StepIntegrals(
        decay=np.exp(-q),
        now=step * np.where(small, now, i0 - i1),
        before=step * np.where(small, before, i1),
        mean=step * np.where(small, mean, 6.0 * (i1 - i2)),
    )
