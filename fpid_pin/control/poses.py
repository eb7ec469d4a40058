"""Poses of an arm at which it is looked at: home, drawn ones, and the worst by some measure."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray

#: Searches for a worst pose: the best of so many is within 0.2 % of that of 24 on every arm tried.
STARTS = 12
#: A valley of nearly singular poses is narrow and bent: memory of all directions, and no early end.
_SEARCH = {"maxcor": 30, "ftol": 1e-12}


def pose_limits(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return the joints' lower and upper limits, half a turn either way where there is none."""
    low = np.where(np.isfinite(arm.lower), arm.lower, -np.pi)
    return low, np.where(np.isfinite(arm.upper), arm.upper, np.pi)


def seeded_poses(arm: Arm, poses: int, seed: int) -> FloatArray:
    """Return the home pose and others drawn within the limits, (poses, n)."""
    rng = np.random.default_rng(seed)
    return np.vstack([arm.home, rng.uniform(*pose_limits(arm), (poses - 1, arm.n))])


def worst_pose(
    arm: Arm, measure: Callable[[FloatArray], tuple[float, FloatArray]], poses: FloatArray
) -> tuple[float, FloatArray]:
    """Return the largest value of a positive measure of poses that is found, and where.

    The measure gives its value and its derivative by the pose, (n,). It is searched from the worst
    `STARTS` of `poses`, (poses, n), within the joints' limits: docs/gains.md says why.
    """
    from scipy.optimize import minimize

    def objective(q: FloatArray) -> tuple[float, FloatArray]:
        value, slope = measure(q)
        return -np.log(value), -slope / value

    low, high = pose_limits(arm)
    bounds = list(zip(low, np.maximum(low, high), strict=True))
    starts = poses[np.argsort([-measure(q)[0] for q in poses])[:STARTS]]
    ends = [
        minimize(objective, q, jac=True, method="L-BFGS-B", bounds=bounds, options=_SEARCH).x
        for q in starts
    ]
    found = [(measure(q)[0], q) for q in (starts[0], *ends)]
    return max(found, key=lambda x: x[0])


def gravity_stiffness(arm: Arm, q: FloatArray) -> FloatArray:
    """Return dG/dq at `q`, (n, n) [N m/rad]."""
    return np.array(pin.computeGeneralizedGravityDerivatives(arm.model, arm.model.createData(), q))


def inertia_slope(arm: Arm, q: FloatArray, v: FloatArray) -> FloatArray:
    """Return the derivative of v^T M(q) v by q, (n,): that M' - 2 C is skew gives it."""
    return np.asarray(2.0 * arm.coriolis_matrix(q, v).T @ v)


def heaviness(arm: Arm, scale: FloatArray, q: FloatArray) -> tuple[float, FloatArray]:
    """Return the largest eigenvalue of M over a scale, (n,), and its derivative by q, (n,)."""
    root = 1.0 / np.sqrt(scale)
    values, vectors = np.linalg.eigh(root[:, np.newaxis] * arm.mass_matrix(q) * root)
    return float(values[-1]), inertia_slope(arm, q, root * vectors[:, -1])


def gravity_instability(arm: Arm, scale: FloatArray, q: FloatArray) -> tuple[float, FloatArray]:
    """Return the largest eigenvalue of -dG/dq over a scale, at least 1e-9, and its derivative."""
    root = 1.0 / np.sqrt(scale)
    stiffness = root[:, np.newaxis] * gravity_stiffness(arm, q) * root
    values, vectors = np.linalg.eigh(-0.5 * (stiffness + stiffness.T))
    along = root * vectors[:, -1]
    # x^T (dK/dq) x of the second derivative K of an energy is that of K x in the direction x.
    step = 1e-4 * along / np.abs(along).max()
    change = gravity_stiffness(arm, q - step) - gravity_stiffness(arm, q + step)
    slope = 0.5e4 * np.abs(along).max() * change @ along
    return max(1e-9, float(values[-1])), slope * (values[-1] > 1e-9)


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
