"""What happens to the arms in a tick; their accelerations come from outside, from Pinocchio.

Arrays are (runs, n), states x = [q, q'] (2, runs, n). Runs with the same disturbance or reference
share its samples: tables are (..., K, groups, n), and the records say which group is their own.
"""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import clip

#: A joint of a plant: effort limit, viscous friction F_v, a torque from outside, the speed beyond
#: which its run is lost; the groups of its disturbance and of its reference.
PLANT = layout("limit viscous push runaway", "disturbance reference")


@kernel(inline=True)
def drive_one(r, plants, torque, x, forces, k, rows, tau):
    """Clip a run's torques at its drives' limits; record q, q' and torque as row k.

    `tau` is what turns the arm: the torque, what pushes from outside, and F_v q' against it.
    Returns whether a torque is not finite.
    """
    lost = False
    for j in range(plants.shape[1]):
        c = plants[r, j]
        # Asked before the limits, which would hide it.
        lost = lost or not math.isfinite(torque[r, j])
        u = clip(torque[r, j], c.limit)
        rows[0, k, r, j] = x[0, r, j]
        rows[1, k, r, j] = x[1, r, j]
        rows[2, k, r, j] = u
        tau[r, j] = u + c.push - c.viscous * x[1, r, j] + forces[k, c.disturbance, j]
    return lost


@kernel
def drive(alive, plants, torque, x, forces, k, rows, tau):
    """Drive every run, those that have ended by zeros; return whether a torque is not finite."""
    lost = False
    for r in range(alive.size):
        if drive_one(r, plants, torque, x, forces, k, rows, tau) and alive[r]:
            lost = True
    return lost


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
def euler(x, a, h):
    """Take a step of semi-implicit Euler in every run."""
    for r in range(x.shape[1]):
        accelerate(x[1, r], a[r], h)
        coast(x[0, r], x[1, r], h)


@kernel
def accelerate_all(x, a, h):
    """Take the first half of a step in every run."""
    for r in range(x.shape[1]):
        accelerate(x[1, r], a[r], h)


@kernel
def coast_all(x, h):
    """Take the second half of a step in every run."""
    for r in range(x.shape[1]):
        coast(x[0, r], x[1, r], h)


@kernel
def stage(x, slope, tau, plants, forces, at, k, part, x_next, tau_next):
    """Go on along a slope, (2, runs, n), by `part` of a time: a stage of RK4, and its torques.

    They differ from `tau` in the disturbance, that of table `at` in place of 0, and in F_v q'.
    """
    for r in range(x.shape[1]):
        for j in range(x.shape[2]):
            c = plants[r, j]
            x_next[0, r, j] = x[0, r, j] + part * slope[0, r, j]
            x_next[1, r, j] = x[1, r, j] + part * slope[1, r, j]
            brake = c.viscous * (x_next[1, r, j] - x[1, r, j])
            change = forces[at, k, c.disturbance, j] - forces[0, k, c.disturbance, j]
            tau_next[r, j] = tau[r, j] + change - brake


@kernel
def runge_kutta(x, slopes, h):
    """Take a step of the classical Runge-Kutta rule in every run, from the slopes of its stages."""
    for i in range(2):
        for r in range(x.shape[1]):
            for j in range(x.shape[2]):
                middle = 2.0 * slopes[1, i, r, j] + 2.0 * slopes[2, i, r, j]
                x[i, r, j] += h / 6.0 * (slopes[0, i, r, j] + middle + slopes[3, i, r, j])


@kernel(inline=True)
def look(r, plants, x, references, k, seen):
    """Look up row k of a run's reference; return whether it has run away or lost its numbers.

    `seen` is what the laws will see, (5, runs, n): angles, rates and accelerations to follow.
    """
    lost = False
    for j in range(x.shape[2]):
        c = plants[r, j]
        slow = abs(x[1, r, j]) <= c.runaway
        lost = lost or not slow or not math.isfinite(x[0, r, j])
        for i in range(3):
            seen[2 + i, r, j] = references[i, k, c.reference, j]
    return lost


@kernel
def arrive(alive, plants, x, references, k, seen):
    """Look up row k of the references of all runs; return whether one is lost."""
    lost = False
    for r in range(alive.size):
        if alive[r] and look(r, plants, x, references, k, seen):
            lost = True
    return lost
