"""What happens to the arms in a tick; their accelerations come from outside, from Pinocchio.

Arrays are (runs, n). Runs with the same disturbance or reference share its samples: tables are
(..., K, groups, n), and `group` says which of them is a run's.
"""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import clip

#: A joint's drive: effort limit, viscous friction F_v, and a torque from outside.
DRIVE = layout("limit viscous push")


@kernel
def drive(alive, drives, torque, q, v, k, rows, tau):
    """Clip the torques at the drives' limits; record q, q' and torque as row k; F_v q' brakes.

    Returns whether a torque is not finite.
    """
    lost = False
    for r in range(alive.size):
        for j in range(drives.shape[1]):
            c = drives[r, j]
            u = 0.0
            if alive[r]:
                # Asked before the limits, which would hide it.
                lost = lost or not math.isfinite(torque[r, j])
                u = clip(torque[r, j], c.limit)
            rows[0, k, r, j] = q[r, j]
            rows[1, k, r, j] = v[r, j]
            rows[2, k, r, j] = u
            tau[r, j] = u + c.push - c.viscous * v[r, j]
    return lost


@kernel
def disturb(tau, forces, group, k, total):
    """Add the disturbance of row k to the torques on the arms."""
    for r in range(group.size):
        for j in range(tau.shape[1]):
            total[r, j] = tau[r, j] + forces[k, group[r], j]


@kernel(inline=True)
def accelerate(v, a, h):
    """Take the first half of a step of semi-implicit Euler: v+ = v + h a."""
    for j in range(v.size):
        v[j] += h * a[j]


@kernel(inline=True)
def coast(q, v, h):
    """Take its second half: q+ = q + h v+."""
    for j in range(q.size):
        q[j] += h * v[j]


@kernel
def euler(q, v, a, h):
    """Take a step of semi-implicit Euler in every run."""
    for r in range(q.shape[0]):
        accelerate(v[r], a[r], h)
        coast(q[r], v[r], h)


@kernel
def accelerate_all(v, a, h):
    """Take the first half of a step in every run."""
    for r in range(v.shape[0]):
        accelerate(v[r], a[r], h)


@kernel
def coast_all(q, v, h):
    """Take the second half of a step in every run."""
    for r in range(q.shape[0]):
        coast(q[r], v[r], h)


@kernel
def stage(q, v, slopes, i, part, q_next, v_next):
    """Go from (q, v) along slope i, of (2, 4, runs, n), by `part` of a time: a stage of RK4."""
    for r in range(q.shape[0]):
        for j in range(q.shape[1]):
            q_next[r, j] = q[r, j] + part * slopes[0, i, r, j]
            v_next[r, j] = v[r, j] + part * slopes[1, i, r, j]


@kernel(inline=True)
def simpson(slopes, i, r, j):
    """Return the mean slope of the four stages."""
    middle = 2.0 * slopes[i, 1, r, j] + 2.0 * slopes[i, 2, r, j]
    return (slopes[i, 0, r, j] + middle + slopes[i, 3, r, j]) / 6.0


@kernel
def runge_kutta(q, v, slopes, h):
    """Take a step of the classical Runge-Kutta rule in every run, from the slopes of its stages."""
    for r in range(q.shape[0]):
        for j in range(q.shape[1]):
            q[r, j] += h * simpson(slopes, 0, r, j)
            v[r, j] += h * simpson(slopes, 1, r, j)


@kernel
def arrive(alive, q, v, runaway, references, group, k, seen):
    """Look up row k of the references, and return whether a run has run away or lost its numbers.

    `seen` is what the laws will see, (5, runs, n): q and q' are written to it unless they are it.
    """
    lost = False
    for r in range(alive.size):
        if not alive[r]:
            continue
        for j in range(q.shape[1]):
            sound = math.isfinite(q[r, j]) and abs(v[r, j]) <= runaway[r]
            lost = lost or not sound
            for i in range(3):
                seen[2 + i, r, j] = references[i, k, group[r], j]
    return lost
