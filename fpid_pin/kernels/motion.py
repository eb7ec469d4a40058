"""What happens to the arms in a tick, their accelerations being Pinocchio's (or another kernel's)."""

from __future__ import annotations

import math

import numpy as np

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import clip

f8 = np.float64

#: A joint of a plant: its drive's limit, viscous friction F_v, and a push from outside.
DRIVE = np.dtype((np.record, [(name, f8) for name in ("limit", "viscous", "push")]))


@kernel
def drive(alive, drives, torque, v, force, group, k, applied, tau):
    """Write what the drives give, and with it all torques on the arms: u + d(t) - F_v q'.

    `force` is (groups, K, n): runs with the same disturbance share its samples.
    """
    for r in range(alive.size):
        d = force[group[r], k]
        for j in range(drives.shape[1]):
            c = drives[r, j]
            applied[r, j] = 0.0
            tau[r, j] = 0.0
            if alive[r]:
                applied[r, j] = clip(torque[r, j], c.limit)
                tau[r, j] = applied[r, j] + d[j] + c.push - c.viscous * v[r, j]


@kernel
def euler(alive, q, v, a, h):
    """One step of semi-implicit Euler, first half: v+ = v + h a."""
    for r in range(alive.size):
        for j in range(v.shape[1]):
            v[r, j] += h * a[r, j]


@kernel
def advance(q, v, h):
    """Second half: q+ = q + h v+."""
    for r in range(q.shape[0]):
        for j in range(q.shape[1]):
            q[r, j] += h * v[r, j]
