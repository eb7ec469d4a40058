"""The gains nearest to wanted ones that a sampled loop bears, damped at every pose looked at."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.ceilings import DerivativeBound
from fpid_pin.control.damping import FrozenLoops

#: What a missing bit of damping ratio weighs beside the logarithm of one joint's gains.
PENALTY = 100.0
#: Poles that are watched at a pose: the least damped changes as gains do, and would be a kink.
PAIRS = 4
#: How often poses may be added at which the last gains were found wanting.
ROUNDS = 8
#: Parts of the bandwidth to start from, one after another until less damping than that is missing.
STARTS, ENOUGH = (1.0, 0.5, 0.2), 0.1
#: Missing damping ratio, and share of the bound used in excess, that no round is spent on.
SLACK = 0.01


def nearest_gains(
    loops: FrozenLoops, bound: DerivativeBound, wanted: FloatArray, *, part: float,
    damping: FloatArray,
) -> FloatArray:  # fmt: skip
    """Lower gains, joint by joint, no further than damping and the bound on Kd ask.

    Parameters
    ----------
    loops
        At the poses where damping counts.
    bound
        On Kd, over all poses.
    wanted
        Kp, Ki, Kd, (3, n), scale included.
    part
        Of the bound that may be used up.
    damping
        Least damping ratio at each pose of `loops`.

    Returns
    -------
    FloatArray
        (3, n).

    Notes
    -----
    Maximises the sum of all ln K, so that a gain gives up little where another can do as much, by
    sequential quadratic programming (SLSQP) with exact derivatives of poles and loads. A pose
    counts from when gains have been found wanting there. Where nothing satisfies all constraints
    the damping ratios fall short by the same, least, amount. Where a search ends far from what is
    wanted another begins at less bandwidth.
    """
    from scipy.optimize import minimize

    n = wanted.shape[1]
    slower = np.array([2.0, 3.0, 1.0])  # Kp, Ki, Kd go with these powers of the bandwidth
    merit = np.append(-np.ones(3 * n), PENALTY)
    limits = [(-8.0, 0.0)] * (3 * n) + [(0.0, 2.0)]
    active_bound: list[FloatArray] = []
    active_damping: list[int] = []

    def gains(y: FloatArray) -> FloatArray:
        return np.asarray(wanted * np.exp(y[:-1].reshape(3, n)))

    @lru_cache(maxsize=1)
    def constraints(key: bytes) -> tuple[FloatArray, FloatArray]:
        """Return what has to be >= 0, and its derivatives by (ln K, shortfall)."""
        y = np.frombuffer(key)
        table = gains(y)
        values, rows = [], []
        for pose in active_bound:
            load, share = bound.shares(table[2], pose)
            values.append(np.log(part / load))
            rows.append([*np.zeros(2 * n), *-share, 0.0])
        for k in active_damping:
            for ratio, slope in zip(*loops.slopes(table, k, count=PAIRS), strict=True):
                values.append(ratio - damping[k] + y[-1])
                rows.append([*slope.reshape(-1), 1.0])
        return np.array(values), np.array(rows)

    held: Any = {
        "type": "ineq",
        "fun": lambda y: constraints(y.tobytes())[0],
        "jac": lambda y: constraints(y.tobytes())[1],
    }

    def searched(y: FloatArray) -> FloatArray:
        """Return the gains that are found from a start."""
        for turn in range(ROUNDS):
            short = damping - loops.ratios(gains(y)) - y[-1]
            new = [k for k in np.flatnonzero(short > SLACK).tolist() if k not in active_damping]
            load, pose = bound.worst(gains(y)[2])
            heavy = load > (1.0 + SLACK) * part
            # A lowered start may be damped where the first was not, and lower than it need be.
            if not new and not heavy and (turn or not active_damping):
                break
            active_damping.extend(new)
            active_bound.extend([pose] * heavy)
            constraints.cache_clear()
            y = minimize(
                lambda y: merit @ y, y, jac=lambda _: merit, method="SLSQP", bounds=limits,
                constraints=held, options={"maxiter": 20, "ftol": 1e-3},
            ).x  # fmt: skip
            if y[-1] > damping.max():
                break  # unstable somewhere at best
        table = gains(y)
        table[2] *= min(1.0, part / max(bound.worst(table[2])[0], 1e-300))
        return table

    found, least = wanted, np.inf
    for lowered in STARTS:
        start = np.append(np.repeat(np.log(lowered) * slower, n), 0.0)
        table = searched(start)
        short = float((damping - loops.ratios(table)).max())
        if short < least:
            found, least = table, short
        if least < ENOUGH:
            break
    return found
