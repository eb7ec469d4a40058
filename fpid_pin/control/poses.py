"""Poses of an arm at which it is looked at: home, drawn ones, and the worst by some measure."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Step of the difference that gives dG/dq [rad]: error and rounding are both about 1e-10 of G.
STIFFNESS_STEP = 1e-5


def pose_limits(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return the joints' lower and upper limits, half a turn either way where there is none."""
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    return low, np.where(np.isfinite(arm.upper), arm.upper, np.pi)


def seeded_poses(arm: Arm, poses: int, seed: int) -> FloatArray:
    """Return the home pose and others drawn within the limits, (poses, n)."""
    rng = np.random.default_rng(seed)
    return np.vstack([arm.home, rng.uniform(*pose_limits(arm), (poses - 1, arm.n))])


def worst_pose(
    arm: Arm, measure: Callable[[FloatArray], float], poses: FloatArray
) -> tuple[float, FloatArray]:
    """Return the largest value of a positive measure of poses that is found, and where.

    Searched from the two worst of `poses`, (poses, n), by L-BFGS-B within the joints' limits: where
    an arm is nearly singular samples miss the worst by far.
    """
    from scipy.optimize import minimize

    values = np.array([measure(q) for q in poses])
    order = np.argsort(-values)
    low, high = pose_limits(arm)
    found = [(float(values[order[0]]), poses[order[0]])]
    for k in order[:2]:
        q = minimize(
            lambda q: -np.log(measure(q)), poses[k], method="L-BFGS-B",
            bounds=list(zip(low, np.maximum(low, high), strict=True)), options={"maxiter": 30},
        ).x  # fmt: skip
        found.append((measure(q), q))
    return max(found, key=lambda x: x[0])


def gravity_stiffness(arm: Arm, q: FloatArray) -> FloatArray:
    """Return dG/dq at `q`, (n, n) [N m/rad], by central differences."""
    shifts = STIFFNESS_STEP * np.eye(arm.n)
    ends = [arm.gravity_vector(q + x) - arm.gravity_vector(q - x) for x in shifts]
    return np.stack(ends, axis=1) / (2.0 * STIFFNESS_STEP)


def joints_that_fall(arm: Arm, q: FloatArray, limit: FloatArray, when: str) -> list[str]:
    """Return a line for each joint whose weight at a pose is beyond its limit, (n,) [N m]."""
    weight = np.abs(arm.gravity_vector(q))
    return [
        f"{arm.name}: joint {joint}: gravity {when} is {load:.3g} {unit}, beyond its effort limit "
        f"of {most:.3g} {unit}"
        for joint, load, most, unit in zip(
            arm.joint_names, weight, limit, arm.effort_units, strict=True
        )
        if load > most
    ]
