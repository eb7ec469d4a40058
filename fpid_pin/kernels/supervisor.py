"""The supervisors, the paper's, eqs. (14)-(20), and one for loops that are sampled; the observer.

The observer finds the speed of each joint, and the acceleration that the model lacks:

    v^ = v^- + (1 - p^2) (v - v^-),   xi += (1 - p)^2/h (v - v^-),   p = exp(-omega h)
    v^- of the next sample = v^ + h (a(q, v^, u) + xi)

Both error poles are p; a(q, v^, u) is the nominal model's acceleration over a step, viscous
friction implicit and of the measured speed, (M + h F_v) a = u - C v^ - G - F_v v. It is a
Luenberger observer of the speed with a constant disturbance as its second state, both poles placed
at p (Franklin, Powell and Workman, *Digital Control of Dynamic Systems*, 1998, section 8.2).
"""

import math

from fpid_pin.kernels.functions import clip, sign


def correct_observer(robot, joints):
    """Correct v^ and xi by the measured speeds; without an observer v^ is what is measured."""
    for j in range(joints.size):
        c = joints[j]
        if robot.l1 == 0.0 or robot.ticks == 0:
            c.v_hat = c.v
        else:
            miss = c.v - c.predicted
            c.v_hat = c.predicted + robot.l1 * miss
            c.xi += robot.l2 * miss


def predict(robot, joints, acceleration, change):
    """Say what speed the next sample should find.

    `acceleration` is the model's, (n,); `change` what a supervisor adds to it.
    """
    for j in range(joints.size):
        c = joints[j]
        c.predicted = c.v_hat + robot.h * (acceleration[j] + change[j] + c.xi)


def energy(robot, e, e_dot):
    """Return a joint's part of V, 1/2 E^T P E, eq. (14)."""
    return 0.5 * (robot.p11 * e * e + 2.0 * robot.p12 * e * e_dot + robot.p22 * e_dot * e_dot)


def error_terms(robot, joints, demand, b):
    """Write K^T E of (18) and B^T P E of (20), (n,)."""
    for j in range(joints.size):
        c = joints[j]
        demand[j] = robot.k0 * c.e + robot.k1 * c.e_dot
        b[j] = robot.p12 * c.e + robot.p22 * c.e_dot


def paper_torque(robot, joints, gravity, coriolis, demand, feedforward, w):
    """Write u_s of (20): sgn(w) (G_u + d_u + |C q'| + |M K^T E| + |M q''_d| + |u_FPID|).

    `demand` is M K^T E, `feedforward` M q''_d and w = M^-1 B^T P E, (n,). c.bound is d_u + G_u, or
    d_u alone where G_u is |G(q)| of the model. With a boundary layer, sgn is a ramp within it.
    """
    for j in range(joints.size):
        c = joints[j]
        size = c.bound + abs(c.u_law + c.u_model) + abs(coriolis[j])
        size += abs(demand[j]) + abs(feedforward[j])
        if robot.own_gravity:
            size += abs(gravity[j])
        if robot.layer > 0.0:
            c.u_s = size * clip(w[j] / robot.layer, 1.0)
        else:
            c.u_s = size * sign(w[j])


def find_correction(robot, joints, acceleration, direction):
    """Find where the next error would be, and in which direction u_s must turn it.

    One step ahead V is a quadratic in the error's acceleration a, V = V* + eta/2 |a + g/eta|^2, so
    {V <= V_T} is a ball around -g/eta of radius r. `acceleration` is the model's under the torque
    so far; the observer knows what it lacks. Writes the unit vector of z = a + g/eta, (n,), 0 where
    nothing is to be done, and notes in the robot whether something is.
    """
    h = robot.h
    ahead = robot.lookahead
    eta = ahead * ahead * (robot.p22 + h * robot.p12 + h * h * robot.p11 / 4.0)
    value = 0.0
    least = 0.0
    square = 0.0
    for j in range(joints.size):
        c = joints[j]
        rate = c.v_ref - c.v_hat
        there = c.e + ahead * rate
        g = ahead * (
            (h * robot.p11 / 2.0 + robot.p12) * there + (h * robot.p12 / 2.0 + robot.p22) * rate
        )
        z = c.a_ref - acceleration[j] - c.xi + g / eta
        direction[j] = z
        square += z * z
        value += energy(robot, c.e, rate)
        least += energy(robot, there, rate) - g * g / (2.0 * eta)
    robot.distance = math.sqrt(square)
    robot.radius = math.sqrt(max(2.0 * (robot.target - least) / eta, 0.0))
    robot.correcting = 1 if value >= robot.trigger and robot.distance > 0.0 else 0
    for j in range(joints.size):
        direction[j] = direction[j] / robot.distance if robot.correcting else 0.0


def least_correction(robot, joints, reserve, direction):
    """Scale the direction to the least change that ends in the ball, whatever D does along z.

    That is, |D| <= d_u; docs/supervisor.md says what it can do across. `reserve` is (M + h F_v)^-1
    of the direction, (n,).
    """
    margin = 0.0
    for j in range(joints.size):
        margin += abs(reserve[j]) * joints[j].bound
    change = min(max(robot.distance + margin - robot.radius, 0.0), robot.distance)
    robot.correcting = 1 if robot.correcting and change > 0.0 else 0
    for j in range(joints.size):
        direction[j] *= change if robot.correcting else 0.0
