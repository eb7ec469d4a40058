"""The supervisor of one robot: eqs. (14)-(20)."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import clip


@kernel(inline=True)
def lyapunov(robot, q, v, q_ref, v_ref):
    """Return V = 1/2 sum_j E_j^T P E_j, eq. (14), as a sum of squares: it cannot round below 0."""
    total = 0.0
    for j in range(q.size):
        e = q_ref[j] - q[j]
        e_dot = v_ref[j] - v[j]
        x = robot.l11 * e + robot.l21 * e_dot
        y = robot.l22 * e_dot
        total += x * x + y * y
    return 0.5 * total


@kernel
def weigh(alive, robots, joints, demand, b):
    """Write K^T E of (18) and B^T P E of (20) of every robot, (runs, n)."""
    for r in range(robots.size):
        s = robots[r]
        for j in range(joints.shape[1]):
            demand[r, j] = 0.0
            b[r, j] = 0.0
            if not alive[r]:
                continue
            c = joints[r, j]
            demand[r, j] = s.k0 * c.e + s.k1 * c.e_dot
            b[r, j] = s.p12 * c.e + s.p22 * c.e_dot


@kernel
def supervise(alive, robots, joints, gravity, coriolis, demand, feedforward, w, torque):
    """Add u_s, eq. (20), to the torque of every robot whose supervisor acts.

    The model's terms are (runs, n): G, C q', M K^T E, M q''_d and w = M^-1 B^T P E.
    """
    for r in range(robots.size):
        s = robots[r]
        if not alive[r] or not s.acting:
            continue
        for j in range(joints.shape[1]):
            c = joints[r, j]
            size = c.bound + abs(c.u_fpid) + abs(coriolis[r, j])
            size += abs(demand[r, j]) + abs(feedforward[r, j])
            if s.own_gravity:
                size += abs(gravity[r, j])
            sign = 0.0
            if s.layer > 0.0:
                sign = clip(w[r, j] / s.layer, 1.0)
            elif w[r, j] > 0.0:
                sign = 1.0
            elif w[r, j] < 0.0:
                sign = -1.0
            c.u_s = size * sign
            torque[r, j] = clip(c.u_fpid + c.u_s, c.limit)
            c.cut = c.u_fpid + c.u_s - torque[r, j]
