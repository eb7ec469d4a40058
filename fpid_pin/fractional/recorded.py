"""A design applied to a whole recorded signal.

It gives what a `Bank` gives sample by sample: modes by the same kernel, the rules that keep the
past by FFT, in O(N log N).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.fractional.design import Design, check_grid, check_order, modes_of
from fpid_pin.fractional.history import HistoryDesign
from fpid_pin.fractional.modes import INITIALISATIONS
from fpid_pin.fractional.special import rgamma


def run_modes(
    design: Design,
    order: ArrayLike,
    value: FloatArray,
    rate: FloatArray | None = None,
    *,
    step: float,
    horizon: float | None = None,
    initialisation: str = "caputo",
) -> FloatArray:
    """Return what a bank of `design` gives for a recorded signal.

    Parameters
    ----------
    design
        One with modes.
    order
        Orders in [0, 1], of shape (...).
    value, rate
        f and, where it is known, f', (N, ...): time first.
    step, horizon
        Sampling step and fitted horizon [s]; the record's length when None.
    initialisation
        As in `Bank`.

    Returns
    -------
    ndarray
        D^alpha f, (N, ...).
    """
    # Imported late: it loads numba.
    from fpid_pin.kernels.operator import record

    alpha = check_order(order).reshape(-1)
    samples = len(value)
    step, horizon = check_grid(step, max(samples - 1, 2) * step if horizon is None else horizon)
    checks.choice("initialisation", initialisation, INITIALISATIONS)
    modes = modes_of(design, alpha, step=step, horizon=horizon)
    f = np.ascontiguousarray(value, dtype=np.float64).reshape(samples, -1)
    if rate is None:
        # Constant from one sample to the next: at both ends of a step it is the same.
        start = f[:1] * (initialisation == "grunwald_letnikov")
        slope = last = np.diff(f, axis=0, prepend=f[:1] - start) / step
    else:
        slope = np.ascontiguousarray(rate, dtype=np.float64).reshape(samples, -1)
        last = np.concatenate([slope[:1], slope[:-1]])
    out = np.empty_like(f)
    record(*modes.records(initialisation), f, slope, last, out, step)
    return out.reshape(value.shape)


def run_lags(
    design: HistoryDesign,
    order: ArrayLike,
    value: FloatArray,
    rate: FloatArray | None = None,
    *,
    step: float,
    initialisation: str = "caputo",
) -> FloatArray:
    """Return what a bank of a rule that keeps the past gives: see `run_modes`."""
    # Imported late, as all of SciPy is.
    from scipy import fft

    alpha, samples, first = check_order(order), len(value), value[0]
    lags = design.coefficients(alpha, step=step, horizon=samples * step)
    within = design.starts_within(initialisation)
    base = 0.0 * first if within else first
    increments = np.diff(value, axis=0, prepend=base[None])
    size = fft.next_fast_len(samples + len(lags.weights) - 1, real=True)
    spectrum = fft.rfft(increments, size, axis=0) * fft.rfft(lags.weights, size, axis=0)
    out = fft.irfft(spectrum, size, axis=0)[:samples] + lags.level * (value - base)
    if initialisation != "caputo" and not within:
        t = np.arange(1, samples).reshape((-1,) + (1,) * alpha.ndim) * step
        out[1:] += first * t**-alpha * rgamma(1.0 - alpha)
    # The first sample is known exactly; a transform would leave rounding there.
    out[0] = first * step**-alpha * (initialisation == "grunwald_letnikov")
    if rate is not None:
        np.copyto(out, rate, where=alpha == 1.0)
    np.copyto(out, value, where=alpha == 0.0)
    return np.asarray(out)
