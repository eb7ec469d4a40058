"""A disturbance observer: the speed of each joint, and the acceleration that the model lacks.

    v^ = v^- + (1 - p^2) (v - v^-),   xi += (1 - p)^2/h (v - v^-),   p = exp(-omega h)
    v^- of the next sample = v^ + h (a(q, v^, u) + xi)

Both error poles are p; a(q, v, u) is the nominal model's acceleration.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import clip


@kernel
def correct(alive, robots, joints, v, v_hat, lost):
    """Correct the observers by the measured speeds, (runs, n); without one v^ is what is measured.

    Writes v^, and the accelerations of unknown cause.
    """
    for r in range(robots.size):
        s = robots[r]
        for j in range(joints.shape[1]):
            c = joints[r, j]
            if alive[r]:
                if s.l1 == 0.0 or not s.observing:
                    c.v_hat = v[r, j]
                else:
                    miss = v[r, j] - c.predicted
                    c.v_hat = c.predicted + s.l1 * miss
                    c.xi += s.l2 * miss
            v_hat[r, j] = c.v_hat
            lost[r, j] = c.xi
        if alive[r]:
            s.observing = 1


@kernel
def compensate(alive, joints, feedforward, disturbance, torque):
    """Add the model's part of the torque, u_m: feedforward less what disturbs, (runs, n)."""
    for r in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            c = joints[r, j]
            if alive[r]:
                c.u_m = feedforward[r, j] - disturbance[r, j]
                torque[r, j] = clip(c.u_fpid + c.u_m, c.limit)
                c.cut = c.u_fpid + c.u_m - torque[r, j]


@kernel
def brake(joints, torque, v_hat, tau):
    """Write the torques that move the nominal arm: those of the drives less F_v v^."""
    for r in range(joints.shape[0]):
        for j in range(joints.shape[1]):
            tau[r, j] = torque[r, j] - joints[r, j].viscous * v_hat[r, j]


@kernel
def predict(robots, joints, acceleration, change):
    """Say what speed the next sample should find; `change` is what u_s adds to the model's."""
    for r in range(robots.size):
        for j in range(joints.shape[1]):
            c = joints[r, j]
            c.predicted = c.v_hat + robots[r].h * (acceleration[r, j] + change[r, j] + c.xi)
