"""Designs as continuous or sampled linear systems of SciPy and python-control.

A design's continuous form, from f to D^alpha f, is

    H(s) = sum g_i s/(s + p_i)

For an exponential sum the kernel's excess within the newest step, where the sum stays finite and
t^-alpha does not, is added as one fast mode of the same area and the same mean lag. Everything is
kept diagonal; no polynomial is formed.
"""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError, DesignError
from fpid_pin.fractional.crone import Oustaloup
from fpid_pin.fractional.design import DEFAULT_HORIZON, Design, check_grid, modes_of
from fpid_pin.fractional.special import rgamma

if TYPE_CHECKING:
    # scipy.signal takes longer to load than the rest of the package: imported where used.
    from scipy.signal import StateSpace, ZerosPolesGain


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
    if not isinstance(design, Oustaloup) and alpha > 0.0:
        area, mean_lag = _excess(alpha, poles, weights, step)
        # A sum of very few modes may have nothing to add to.
        if area > 0.0 and mean_lag > 0.0:
            poles = np.append(poles, 1.0 / mean_lag)
            weights = np.append(weights, area / mean_lag)
    used = (weights != 0.0) | (poles == 0.0)
    return poles[used], weights[used]


def _excess(
    alpha: float, poles: FloatArray, weights: FloatArray, step: float
) -> tuple[float, float]:
    """Return area [s^(1-alpha)] and mean lag [s] of kernel minus sum on the newest step."""
    q = poles[1:] * step
    area = step ** (1.0 - alpha) * rgamma(2.0 - alpha) - weights[0] * step
    area -= float((weights[1:] * -np.expm1(-q) / poles[1:]).sum())
    moment = step ** (2.0 - alpha) * rgamma(1.0 - alpha) / (2.0 - alpha) - weights[0] * step**2 / 2
    inner = (-np.expm1(-q) - q * np.exp(-q)) / poles[1:] ** 2
    moment -= float((weights[1:] * inner).sum())
    return float(area), float(moment / area)


def state_space(
    design: Design,
    order: float,
    *,
    step: float,
    horizon: float = DEFAULT_HORIZON,
    sampled: bool = False,
    rate: str = "measured",
) -> StateSpace:
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
    if sampled:
        return _sampled(design, order, step, horizon, rate)
    poles, weights = continuous_modes(design, order, step=step, horizon=horizon)
    # g s/(s + p) = g - g p/(s + p)
    return _diagonal([(poles, -weights * poles)], weights.sum())


def _sampled(design: Design, order: float, step: float, horizon: float, rate: str) -> StateSpace:
    from scipy.signal import StateSpace

    alpha = np.asarray(checks.number("order", order, low=0.0, high=1.0))
    step, horizon = check_grid(step, horizon)
    measured = checks.choice("rate", rate, ("measured", "differenced")) == "measured"
    r = modes_of(design, alpha, step=step, horizon=horizon).recursion(measured=measured)
    # The states are the last sample's inputs, and the modes.
    inputs, modes = r.now.size, r.decay.size
    a = np.block([[np.zeros((inputs, inputs + modes))], [r.drive_before, np.diag(r.decay)]])
    b = np.concatenate([np.eye(inputs), r.drive_now])
    c = np.concatenate([r.before, r.weights])
    return StateSpace(a, b, c[None], r.now[None], dt=step)


def zeros_poles_gain(
    design: Design, order: float, *, step: float, horizon: float = DEFAULT_HORIZON
) -> ZerosPolesGain:
    """Return one continuous operator as a `scipy.signal.ZerosPolesGain`.

    A CRONE filter's are those of its formula. Those of an exponential sum are found between its
    poles, with which they interlace.

    Parameters
    ----------
    design, order, step, horizon
        As in `state_space`.
    """
    from scipy.optimize import brentq
    from scipy.signal import ZerosPolesGain

    if isinstance(design, Oustaloup):
        return ZerosPolesGain(*design.zpk(order))
    poles, weights = continuous_modes(design, order, step=step, horizon=horizon)
    used = np.argsort(poles[1:]) + 1
    p, g, direct = poles[used], weights[used], weights[0]

    def value(log_s: float) -> float:
        s = -np.exp(log_s)
        return float(direct + (g * s / (s + p)).sum())

    edges = np.log(p)
    below = edges[0] - 1.0
    while p.size and value(below) <= 0.0 and below > -700.0:
        below -= 5.0
    ends = np.concatenate([[below], edges])
    zeros = []
    for low, high in itertools.pairwise(ends):
        gap = 1e-13 * max(1.0, abs(high), abs(low))
        a, b = (low if low == below else low + gap), high - gap
        if value(a) * value(b) > 0.0:
            # A zero closer to a pole than rounding resolves: the pair cancels.
            zeros.append(-np.exp(a if abs(value(a)) < abs(value(b)) else b))
        else:
            zeros.append(-np.exp(brentq(value, a, b, xtol=1e-15, rtol=1e-15)))
    return ZerosPolesGain(np.array(zeros), -p, float(weights.sum()))


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
) -> StateSpace:
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
    if ki != 0.0:
        # I^lambda e = D^(1-lambda) int e: s/(s + p) becomes 1/(s + p).
        if lam == 0.0:
            direct += ki
        else:
            poles, weights = continuous_modes(design, 1.0 - lam, step=step, horizon=horizon)
            parts.append((poles, ki * weights))
    if kd != 0.0:
        if mu == 1.0:
            if filter_time is None:
                raise DesignError(
                    "derivative_order: expected a number below 1, or a filter_time, got 1"
                )
            tau = checks.number("filter_time", filter_time, above=0.0)
            poles, weights = np.array([0.0, 1.0 / tau]), np.array([0.0, 1.0 / tau])
        else:
            poles, weights = continuous_modes(design, mu, step=step, horizon=horizon)
        direct += kd * float(weights.sum())
        parts.append((poles, -kd * weights * poles))
    return _diagonal(parts, direct)


def _diagonal(parts: list[tuple[FloatArray, FloatArray]], direct: float) -> StateSpace:
    """Return the state space of ``direct + sum r/(s + p)``, one state for each distinct pole."""
    from scipy.signal import StateSpace

    poles, residues = (np.concatenate([np.zeros(1), *part]) for part in zip(*parts, strict=True))
    distinct, where = np.unique(poles, return_inverse=True)
    total = np.bincount(where, residues)
    # One state is kept where none is needed: a gain alone has no state space in SciPy.
    used = total != 0.0
    used[0] |= not used.any()
    root = np.sqrt(np.abs(total[used]))[:, None]
    c = np.sign(total[used]) * root[:, 0]
    return StateSpace(np.diag(-distinct[used]), root, c[None], [[float(direct)]])


def python_control() -> Any:
    """Return the python-control package, or None where it is not installed.

    A folder named ``control`` on the path imports too, as an empty package; it is not taken for it.
    """
    try:
        import control
    except ImportError:
        return None
    return control if hasattr(control, "StateSpace") else None


def to_control(system: StateSpace) -> Any:
    """Return a SciPy state space as python-control's `StateSpace`.

    Raises
    ------
    DesignError
        python-control is not installed (``pip install fpid_pin[control]``).
    """
    control = python_control()
    if control is None:
        raise DesignError(
            "control: expected python-control to be installed (pip install 'fpid_pin[control]'),"
            " got none"
        )
    dt = 0 if system.dt is None else system.dt
    return control.StateSpace(system.A, system.B, system.C, system.D, dt)
