"""Exact integrals of a decaying mode over one sampling step.

A mode obeys x' = -p x + f'. Over a step h, with q = p h and theta running back from the newest
sample, the rate is the quadratic through both measured rates whose mean is the measured change:

    x_k = E x_(k-1) + b1 f'_k + b0 f'_(k-1) + b2 m_k
    b1, b0, b2 = h int_0^1 exp(-q theta) {1 - theta, theta, 6 theta (1 - theta)} dtheta

Written with f instead of m (m_k = (f_k - f_(k-1))/h - (f'_k + f'_(k-1))/2) this is

    x_k = E x_(k-1) + now f'_k + before f'_(k-1) + gain (f_k - f_(k-1))
    now = b1 - b2/2,   before = b0 - b2/2,   gain = b2/h
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fpid_pin.checks import FloatArray

# Below this q the closed forms cancel and the power series converges within its length.
_SERIES_BELOW = 1.0
_SERIES_TERMS = 20


@dataclass(frozen=True, eq=False)
class StepIntegrals:
    """One step of the modes with decay rates p, arrays of the poles' shape.

    Attributes
    ----------
    decay
        E = exp(-p h).
    now, before
        Weights of f'_k and f'_(k-1) [s].
    gain
        Weight of f_k - f_(k-1).
    flat_gain
        Weight of f_k - f_(k-1) where the rate is constant over the step.
    """

    decay: FloatArray
    now: FloatArray
    before: FloatArray
    gain: FloatArray
    flat_gain: FloatArray


def step_integrals(poles: FloatArray, step: float) -> StepIntegrals:
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
    now = i0 - 4.0 * i1 + 3.0 * i2
    before = 3.0 * i2 - 2.0 * i1
    gain = 6.0 * (i1 - i2)

    # The same four as power series, whose terms are combined before they are summed: the leading
    # ones cancel exactly (a mode with p = 0 is f - f(0) and owes nothing to the rates).
    s_now, s_before, s_gain, s_flat = (np.zeros_like(q) for _ in range(4))
    term = np.ones_like(q)
    for k in range(_SERIES_TERMS):
        s_now += term * (-2.0 * k / ((k + 1) * (k + 2) * (k + 3)))
        s_before += term * (k / ((k + 2) * (k + 3)))
        s_gain += term * (6.0 / ((k + 2) * (k + 3)))
        s_flat += term / (k + 1)
        term = term * (-near / (k + 1))
    return StepIntegrals(
        decay=np.exp(-q),
        now=step * np.where(small, s_now, now),
        before=step * np.where(small, s_before, before),
        gain=np.where(small, s_gain, gain),
        flat_gain=np.where(small, s_flat, i0),
    )
