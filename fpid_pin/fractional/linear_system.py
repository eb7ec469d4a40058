"""Fractional operators as linear systems of SciPy, for Bode plots and margins.

A design's continuous form, from f to D^alpha f, is ``H(s) = sum g_i s/(s + p_i)``. For an
exponential sum the kernel's excess within the newest step, where the sum stays finite and t^-alpha
does not, is added as one fast mode of the same area and the same mean lag.
"""

from __future__ import annotations

import numpy as np
import scipy

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError
from fpid_pin.fractional.crone import Crone
from fpid_pin.fractional.design import DEFAULT_HORIZON, Design, integrate_step, modes_of


def state_space(
    design: Design,
    order: float,
    *,
    step: float,
    horizon: float = DEFAULT_HORIZON,
    sampled: bool = False,
) -> scipy.signal.StateSpace:
    """Return one operator as a `scipy.signal.StateSpace`.

    For python-control: ``control.ss(s.A, s.B, s.C, s.D)``.

    Parameters
    ----------
    design
        How the operator is realised.
    order
        Order alpha in [0, 1); 1 as well where `sampled`.
    step, horizon
        Sampling step and fitted horizon [s].
    sampled
        False: continuous, from f to D^alpha f. True: what a `Bank` does, exactly, at steps of
        `step`, from (f, f').

    Raises
    ------
    ArgumentError
        Order 1 in continuous time, which is s and not proper.
    """
    alpha = checks.number("order", order, low=0.0, high=1.0)
    modes = modes_of(design, alpha, step=step, horizon=horizon)
    if sampled:
        r = modes.recursion()
        # The states are the last sample's inputs, and the modes.
        inputs = r.now.size
        a = np.block(
            [[np.zeros((inputs, inputs + r.decay.size))], [r.drive_before, np.diag(r.decay)]]
        )
        b = np.concatenate([np.eye(inputs), r.drive_now])
        c = np.concatenate([r.before, r.weights])
        return scipy.signal.StateSpace(a, b, c[None], r.now[None], dt=step)
    if alpha == 1.0:
        raise ArgumentError("order", "a number below 1 (order 1 is s, not proper)", "1")
    poles, weights = modes.poles, modes.weights
    if not isinstance(design, Crone) and alpha > 0.0:
        # Area and first moment of kernel minus sum on the newest step.
        one = integrate_step(poles, step)
        exact = step ** (1.0 - alpha) * scipy.special.rgamma(2.0 - alpha)
        area = exact - (weights * (one["b1"] + one["b0"])).sum()
        moment = exact * step * (1.0 - alpha) / (2.0 - alpha)
        moment -= (weights * one["b0"]).sum() * step
        # A sum of very few modes may have nothing to add to.
        if area > 0.0 and moment > 0.0:
            poles = np.append(poles, area / moment)
            weights = np.append(weights, area**2 / moment)
    # g s/(s + p) = g - g p/(s + p); the mode with p = 0 is a gain alone.
    return scipy.signal.StateSpace(
        np.diag(-poles), np.ones((poles.size, 1)), -(weights * poles)[None], [[weights.sum()]]
    )
