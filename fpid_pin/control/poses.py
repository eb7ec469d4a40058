"""Poses of an arm: seeded ones, and the one where something is worst."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.sampled import gravity_stiffness

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control.ceilings import DerivativeBound


def limits(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return the joints' lower and upper limits, half a turn either way where there is none."""
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    high = np.where(np.isfinite(arm.upper), arm.upper, np.pi)
    return low, high


def seeded_poses(arm: Arm, poses: int, seed: int) -> FloatArray:
    """Return the home pose and others drawn within the limits, (poses, n)."""
    rng = np.random.default_rng(seed)
    return np.vstack([arm.home, rng.uniform(*limits(arm), (poses - 1, arm.n))])


def worst_pose(
    arm: Arm, measure: Callable[[FloatArray], float], poses: FloatArray, *, polished: int = 2
) -> tuple[float, FloatArray]:
    """Return the largest value of a positive measure of poses that is found, and where.

    The worst of the `poses` given are starts of local searches (L-BFGS-B, within the joints'
    limits): where an arm is nearly singular samples miss the worst by far.

    Parameters
    ----------
    arm
        Whose limits hold.
    measure
        Of a pose, (n,).
    poses
        (poses, n).
    polished
        From how many of them to search.
    """
    from scipy.optimize import minimize

    values = np.array([measure(q) for q in poses])
    order = np.argsort(-values)
    most, where = float(values[order[0]]), poses[order[0]]
    low, high = limits(arm)
    bounds = list(zip(low, np.maximum(low, high), strict=True))
    for k in order[:polished]:
        found = minimize(
            lambda q: -np.log(measure(q)), poses[k], method="L-BFGS-B", bounds=bounds,
            options={"maxiter": 30},
        )  # fmt: skip
        value = measure(found.x)
        if value > most:
            most, where = value, found.x
    return most, where


def telling_poses(arm: Arm, bound: DerivativeBound, scale: FloatArray) -> FloatArray:
    """Return poses at which a loop with equal gains over a scale is likeliest to break, (7, n).

    They are home; where the arm is heaviest, lightest and most toppling, searched for; and three
    seeded ones.

    Parameters
    ----------
    arm
        The arm.
    bound
        That which makes the lightest pose the worst.
    scale
        s_j, (n,): M and dG/dq are compared with it.
    """
    root = 1.0 / np.sqrt(scale)

    def heaviness(q: FloatArray) -> float:
        return float(np.linalg.eigvalsh(root[:, np.newaxis] * arm.mass_matrix(q) * root)[-1])

    def topple(q: FloatArray) -> float:
        stiffness = root[:, np.newaxis] * gravity_stiffness(arm, q) * root
        return max(1e-9, -float(np.linalg.eigvalsh(0.5 * (stiffness + stiffness.T))[0]))

    poses = seeded_poses(arm, 200, 0)
    found = [worst_pose(arm, measure, poses)[1] for measure in (heaviness, topple)]
    return np.vstack([arm.home, *found, bound.worst(scale)[1], poses[1:4]])
