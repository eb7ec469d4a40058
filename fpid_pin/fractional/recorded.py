"""A design applied to a whole recorded signal, mode by mode in compiled code.

It gives what a `Bank` gives sample by sample, to rounding, in O(N) for each mode.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.bank import INITIALISATIONS
from fpid_pin.fractional.design import Coefficients, Design, check_grid, check_order
from fpid_pin.fractional.rows import rows

_BLOCK = 16384


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
    # Imported late: scipy.signal takes longer to load than the rest of the package.
    from scipy.signal import lfilter

    alpha = check_order(order)
    samples = value.shape[0]
    step, horizon = check_grid(step, max(samples - 1, 2) * step if horizon is None else horizon)
    checks.choice("initialisation", initialisation, INITIALISATIONS)
    c = design.coefficients(alpha, step=step, horizon=horizon)
    if not isinstance(c, Coefficients):
        raise ArgumentError("design", "one with modes", type(design).__name__)
    count = alpha.size
    measured, from_rest = rate is not None, initialisation != "caputo"
    r = rows(c, measured=measured, from_rest=from_rest, channels=count)
    # Time last: compiled filters run along contiguous memory.
    f = np.ascontiguousarray(value.reshape(samples, count).T)
    first = f[:, :1].copy()
    relative = f - first
    out = np.zeros_like(f)
    inputs = [relative]
    if rate is not None:
        inputs.append(np.ascontiguousarray(rate.reshape(samples, count).T))
    past = len(inputs)
    for row, signal in enumerate(inputs):
        out += r.weights[row][:, None] * signal
        out[:, 1:] += r.weights[past + row][:, None] * signal[:, :-1]
    if from_rest:
        out += r.weights[2 * past][:, None] * first
    rest = first[:, 0] if from_rest else np.zeros(count)
    start = r.start(rest, inputs[-1][:, 0] if measured else np.zeros(count))
    head = 2 * past + from_rest
    shared = r.decay.shape[1] == 1
    carried = np.array(start)
    # In blocks that stay in the cache while all modes pass over them.
    block = max(_BLOCK // count, 64)
    for begin in range(0, samples, block):
        part = slice(begin, begin + block)
        for mode in range(r.decay.shape[0]):
            drive = relative[:, part]
            if measured:
                drive = drive + r.sigma[mode][:, None] * inputs[1][:, part]
            for rows_of in [slice(None)] if shared else [slice(k, k + 1) for k in range(count)]:
                e = float(r.decay[mode, 0 if shared else rows_of.start])
                w, last = lfilter(
                    [0.0, 1.0], [1.0, -e], drive[rows_of], zi=carried[mode, rows_of, None]
                )
                carried[mode, rows_of] = last[:, 0]
                out[rows_of, part] += r.weights[head + mode, rows_of, None] * w
    flat = alpha.reshape(-1)
    out[:, 0] = 0.0
    if initialisation == "grunwald_letnikov":
        out[:, 0] = c.kick.reshape(-1) * first[:, 0]
    if measured:
        ends = flat == 1.0
        out[ends] = inputs[1][ends]
    out[flat == 0.0] = f[flat == 0.0]
    return out.T.reshape(value.shape)
