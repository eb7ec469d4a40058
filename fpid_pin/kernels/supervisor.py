"""The supervisors: the paper's, eqs. (14)-(20), and one for loops that are sampled."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import clip


@kernel(inline=True)
def energy(robot, e, e_dot):
    """Return a joint's part of V, 1/2 E^T P E, eq. (14)."""
    return 0.5 * (robot.p11 * e * e + 2.0 * robot.p12 * e * e_dot + robot.p22 * e_dot * e_dot)


@kernel(inline=True)
def lyapunov(robot, q, v, q_ref, v_ref):
    """Return V = 1/2 sum_j E_j^T P E_j, eq. (14)."""
    total = 0.0
    for j in range(q.size):
        total += energy(robot, q_ref[j] - q[j], v_ref[j] - v[j])
    return total


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
            size = c.bound + abs(c.u_fpid + c.u_m) + abs(coriolis[r, j])
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
            asked = c.u_fpid + c.u_m + c.u_s
            torque[r, j] = clip(asked, c.limit)
            c.cut = asked - torque[r, j]


@kernel
def project(alive, robots, joints, inputs, acceleration, direction):
    """Find where the next error would be, and in which direction u_s must turn it.

    One step ahead V is a quadratic in the error's acceleration a, V = V* + eta/2 |a + g/eta|^2, so
    {V <= V_T} is a ball around -g/eta of radius r. `acceleration` is the model's under the torque
    so far; the observer knows what it lacks. Writes the unit vector of z = a + g/eta, (runs, n),
    0 where nothing is to be done, and returns whether something is.
    """
    any_pushes = False
    for r in range(robots.size):
        s = robots[r]
        s.pushing = 0
        for j in range(joints.shape[1]):
            direction[r, j] = 0.0
        if not alive[r] or s.lookahead <= 0.0:
            continue
        h = s.h
        ahead = s.lookahead
        eta = ahead * ahead * (s.p22 + h * s.p12 + h * h * s.p11 / 4.0)
        value = 0.0
        least = 0.0
        square = 0.0
        for j in range(joints.shape[1]):
            c = joints[r, j]
            rate = inputs[3, r, j] - c.v_hat
            there = c.e + ahead * rate
            g = ahead * ((h * s.p11 / 2.0 + s.p12) * there + (h * s.p12 / 2.0 + s.p22) * rate)
            z = inputs[4, r, j] - acceleration[r, j] - c.xi + g / eta
            direction[r, j] = z
            square += z * z
            value += energy(s, c.e, rate)
            least += energy(s, there, rate) - g * g / (2.0 * eta)
        s.distance = math.sqrt(square)
        s.radius = math.sqrt(max(2.0 * (s.target - least) / eta, 0.0))
        if value >= s.trigger and s.distance > 0.0:
            s.pushing = 1
            any_pushes = True
        for j in range(joints.shape[1]):
            direction[r, j] = direction[r, j] / s.distance if s.pushing else 0.0
    return any_pushes


@kernel
def shorten(alive, robots, joints, reserve, direction):
    """Scale the directions to the least change that ends in the ball, whatever D does along z.

    That is, |D| <= d_u; docs/supervisor.md says what it can do across.

    `reserve` is M^-1 of the directions. Returns whether any change is left.
    """
    any_pushes = False
    for r in range(robots.size):
        s = robots[r]
        margin = 0.0
        for j in range(joints.shape[1]):
            margin += abs(reserve[r, j]) * joints[r, j].bound
        change = min(max(s.distance + margin - s.radius, 0.0), s.distance)
        if not alive[r] or not s.pushing:
            change = 0.0
        s.pushing = 1 if change > 0.0 else 0
        any_pushes = any_pushes or change > 0.0
        for j in range(joints.shape[1]):
            direction[r, j] *= change
    return any_pushes


@kernel
def push(alive, robots, joints, u_s, torque):
    """Add u_s = M (change) to the torque of every robot whose sampled supervisor acts."""
    for r in range(robots.size):
        for j in range(joints.shape[1]):
            c = joints[r, j]
            if alive[r] and robots[r].pushing:
                c.u_s = u_s[r, j]
                asked = c.u_fpid + c.u_m + c.u_s
                torque[r, j] = clip(asked, c.limit)
                c.cut = asked - torque[r, j]
