"""A disturbance observer beside a law, as a linear system about rest: what it does to stability."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.observer_gains import observer_gains
from fpid_pin.control.sampled import LinearSystem, gravity_stiffness

if TYPE_CHECKING:
    from fpid_pin.arms import Arm


def observer_system(
    arm: Arm, q: FloatArray, bandwidth: float, step: float, answer: FloatArray | None = None
) -> LinearSystem:
    """Return the observer of `kernels.observer` at rest at `q`, from [e, e', u of the law] to u.

    Parameters
    ----------
    arm
        The nominal arm.
    q
        The pose, (n,).
    bandwidth
        Above 0 [rad/s].
    step
        Sampling period [s].
    answer
        What the law does about a torque that was observed, (n, n); None: it cancels it, -1.

    Notes
    -----
    The states are the speed that was predicted, and xi. About rest the model's acceleration is
    ``(M + h F_v)^-1 (u - F_v v - (dG/dq) q)``, with q = -e, and ``(M + h F_v) xi`` is cancelled.
    """
    n = arm.n
    first, second = observer_gains(bandwidth, step)
    viscous = np.diag(arm.viscous_friction)
    felt = arm.mass_matrix(q) + step * viscous
    # Rows over [v^-, xi, e, e', u].
    predicted, xi, e, rate, torque = np.split(np.eye(5 * n), 5)
    miss = -rate - predicted
    v_hat = predicted + first * miss
    xi = xi + second * miss
    torque = torque + (-np.eye(n) if answer is None else answer) @ felt @ xi
    load = torque + viscous @ rate + gravity_stiffness(arm, q) @ e
    ahead = v_hat + step * (np.linalg.solve(felt, load) + xi)
    following, known = np.vstack([ahead, xi]), 2 * n
    return LinearSystem(
        following[:, :known], following[:, known:], torque[:, :known], torque[:, known:]
    )


def beside(law: LinearSystem, observer: LinearSystem) -> LinearSystem:
    """Return law and observer as one, from [e, e'] to the torque."""
    ours = law.d.shape[1]
    drive, asked = np.split(observer.b, [ours], axis=1)
    direct, through = np.split(observer.d, [ours], axis=1)
    a = np.block([[law.a, np.zeros((len(law.a), len(observer.a)))], [asked @ law.c, observer.a]])
    b = np.vstack([law.b, drive + asked @ law.d])
    return LinearSystem(a, b, np.hstack([through @ law.c, observer.c]), direct + through @ law.d)


def under(plant: LinearSystem, observer: LinearSystem) -> LinearSystem:
    """Return an arm that an observer drives, from the law's torque to [q, q'], its first states."""
    ours = len(plant.a)
    drive, asked = np.split(observer.b, [ours], axis=1)
    seen, passed = np.split(observer.d, [ours], axis=1)
    # It sees e = -q and e' = -q'.
    top = np.hstack([plant.a - plant.b @ seen, plant.b @ observer.c])
    a = np.vstack([top, np.hstack([-drive, observer.a])])
    b = np.vstack([plant.b @ passed, asked])
    return LinearSystem(a, b, np.eye(ours, len(a)), np.zeros((ours, b.shape[1])))
