"""Designs as continuous or sampled linear systems of SciPy and python-control.

A design's continuous form, from f to D^alpha f, is

    H(s) = sum g_i s/(s + p_i)

For an exponential sum the kernel's excess within the newest step, where the sum stays finite and
t^-alpha does not, is added as one fast mode of the same area and the same mean lag. Everything is
kept diagonal; no polynomial is formed.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional.bank import RATES
from fpid_pin.fractional.crone import Crone
from fpid_pin.fractional.design import (
    DEFAULT_HORIZON,
    Design,
    check_grid,
    integrate_step,
    modes_of,
)


def continuous_modes(
    design: Design, order: float, *, step: float, horizon: float
) -> tuple[FloatArray, FloatArray]:
    """Return poles (modes,) [1/s], 0 first, and weights of ``sum g s/(s + p)``, order below 1."""
    alpha = checks.number("order", order, low=0.0, high=1.0)
    step, horizon = check_grid(step, horizon)
    if alpha == 1.0:
        raise ArgumentError("order", "a number below 1 (order 1 is s, not proper)", "1")
    modes = modes_of(design, alpha, step=step, horizon=horizon)
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
    used = (weights != 0.0) | (poles == 0.0)
    return poles[used], weights[used]


def state_space(
    design: Design,
    order: float,
    *,
    step: float,
    horizon: float = DEFAULT_HORIZON,
    sampled: bool = False,
    rate: str = "measured",
) -> scipy.signal.StateSpace:
    """Return one operator as a `scipy.signal.StateSpace`.

    Parameters
    ----------
    design
        One with modes.
    order
        Order alpha in [0, 1); 1 as well where `sampled`.
    step, horizon
        Sampling step and fitted horizon [s].
    sampled
        False: continuous, from f to D^alpha f. True: what the bank does, exactly, at steps of
        `step`: from (f, f'), or from f where the rate is differenced.
    rate
        As in `Bank`, where `sampled`.

    Raises
    ------
    ArgumentError
        Order 1 in continuous time (not proper), a design without modes.
    """
    if not sampled:
        poles, weights = continuous_modes(design, order, step=step, horizon=horizon)
        # g s/(s + p) = g - g p/(s + p)
        return _diagonal([(poles, -weights * poles)], weights.sum())
    alpha = checks.number("order", order, low=0.0, high=1.0)
    step, horizon = check_grid(step, horizon)
    measured = checks.choice("rate", rate, RATES) == "measured"
    r = modes_of(design, alpha, step=step, horizon=horizon).recursion(measured=measured)
    # The states are the last sample's inputs, and the modes.
    inputs, modes = r.now.size, r.decay.size
    a = np.block([[np.zeros((inputs, inputs + modes))], [r.drive_before, np.diag(r.decay)]])
    b = np.concatenate([np.eye(inputs), r.drive_now])
    c = np.concatenate([r.before, r.weights])
    return scipy.signal.StateSpace(a, b, c[None], r.now[None], dt=step)


def zeros_poles_gain(
    design: Design, order: float, *, step: float, horizon: float = DEFAULT_HORIZON
) -> scipy.signal.ZerosPolesGain:
    """Return one continuous operator as a `scipy.signal.ZerosPolesGain`.

    A CRONE filter's are those of its formula. With D = sum g_i the zeros of an exponential sum are
    the eigenvalues of diag(p) - r r^T/D, r_i^2 = g_i p_i: squares of singular values, which keeps
    the small ones exact.

    Parameters
    ----------
    design, order, step, horizon
        As in `state_space`.
    """
    if isinstance(design, Crone):
        return scipy.signal.ZerosPolesGain(*design.zpk(order))
    poles, weights = continuous_modes(design, order, step=step, horizon=horizon)
    p, gain = poles[1:], float(weights.sum())
    unit = np.sqrt(weights[1:] / gain)
    # (1 - u u^T) = (1 - c u u^T)^2 where c = 1/(1 + root of 1 - |u|^2), and that is g_0/D.
    c = 1.0 / (1.0 + np.sqrt(weights[0] / gain))
    factor = np.sqrt(p)[:, None] * (np.eye(p.size) - c * np.outer(unit, unit))
    zeros = -(np.linalg.svd(factor, compute_uv=False) ** 2)
    return scipy.signal.ZerosPolesGain(zeros, -p, gain)


def fpid_state_space(
    *,
    kp: float,
    ki: float,
    kd: float,
    integral_order: float,
    derivative_order: float,
    design: Design,
    step: float,
    horizon: float = DEFAULT_HORIZON,
    filter_time: float | None = None,
) -> scipy.signal.StateSpace:
    """Return a fixed-gain FPID, u = kp e + ki I^lambda e + kd D^mu e (10), from e to u.

    Continuous, for Bode plots and margins. The modes of both terms are one set of states where
    their poles are shared.

    Parameters
    ----------
    kp, ki, kd
        Gains.
    integral_order, derivative_order
        lambda and mu in [0, 1].
    design
        One with modes.
    step, horizon
        Sampling step and fitted horizon [s].
    filter_time
        Time constant [s] of the filter that mu = 1 needs, ``s/(1 + filter_time s)``.

    Raises
    ------
    ArgumentError
        An order outside [0, 1], gains that are not numbers.
    DesignError
        mu = 1 without `filter_time`: a pure derivative is not a state space.
    """
    kp, ki, kd = (checks.number(n, v) for n, v in (("kp", kp), ("ki", ki), ("kd", kd)))
    lam = checks.number("integral_order", integral_order, low=0.0, high=1.0)
    mu = checks.number("derivative_order", derivative_order, low=0.0, high=1.0)
    direct, parts = kp, [(np.zeros(0), np.zeros(0))]
    if lam == 0.0:
        direct += ki
    elif ki != 0.0:
        # I^lambda e = D^(1-lambda) int e: s/(s + p) becomes 1/(s + p).
        poles, weights = continuous_modes(design, 1.0 - lam, step=step, horizon=horizon)
        parts.append((poles, ki * weights))
    if kd != 0.0:
        if mu < 1.0:
            poles, weights = continuous_modes(design, mu, step=step, horizon=horizon)
        elif filter_time is None:
            raise DesignError(
                "derivative_order: expected a number below 1, or a filter_time, got 1"
            )
        else:
            tau = checks.number("filter_time", filter_time, above=0.0)
            poles = weights = np.array([0.0, 1.0 / tau])
        direct += kd * float(weights.sum())
        parts.append((poles, -kd * weights * poles))
    return _diagonal(parts, direct)


def _diagonal(parts: list[tuple[FloatArray, FloatArray]], direct: float) -> scipy.signal.StateSpace:
    """Return the state space of ``direct + sum r/(s + p)``, one state for each distinct pole."""
    poles, residues = (np.concatenate([np.zeros(1), *part]) for part in zip(*parts, strict=True))
    distinct, where = np.unique(poles, return_inverse=True)
    total = np.bincount(where, residues)
    # One state is kept where none is needed: a gain alone has no state space in SciPy.
    used = total != 0.0
    used[0] |= not used.any()
    root = np.sqrt(np.abs(total[used]))[:, None]
    c = np.sign(total[used]) * root[:, 0]
    return scipy.signal.StateSpace(np.diag(-distinct[used]), root, c[None], [[float(direct)]])


def to_control(system: scipy.signal.StateSpace) -> Any:
    """Return a SciPy state space as python-control's `StateSpace`.

    Raises
    ------
    DesignError
        python-control is not installed (``pip install fpid_pin[control]``).
    """
    try:
        # A folder named ``control`` on the path imports too, but has no such name.
        from control import StateSpace
    except ImportError:
        raise DesignError(
            "control: expected python-control to be installed (pip install 'fpid_pin[control]'),"
            " got none"
        ) from None
    dt = 0 if system.dt is None else system.dt
    return StateSpace(system.A, system.B, system.C, system.D, dt)
