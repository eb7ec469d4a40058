"""The true arm under the drives' torques, over one step; its dry friction as a box problem.

Dry friction, F_d after eq. (6): find v+ and the friction torque l with

    v+ = v_free - W l,  W = h M^-1,   |l_j| <= F_d,j,   l_j = F_d,j sgn(v+_j) where v+_j != 0

by block principal pivoting (Júdice and Pires, Computers & Operations Research 21, 1994): guess
which joints stick, solve, exchange those at fault, repeat.
"""

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.functions import clip, sign
from fpid_pin.kernels.records import WORKSPACE
from fpid_pin.kernels.rigid_body import forward_dynamics, solve_symmetric

#: Relative slack of the conditions on friction and speed, well above rounding.
SLACK = 1e-12
#: Rounds in which every joint at fault changes sides; then one joint a round, which cannot cycle.
BLOCK_ROUNDS = 8


def is_at_fault(c, speed, side, force, response):
    """Return whether a joint that sticks would break loose, or one that slides would turn round."""
    if c.stuck:
        fault = abs(force) > c.dry * (1.0 + SLACK)
    else:
        # Speeds below this are zero: a rounding of what its own friction would do to it.
        fault = c.dry > 0.0 and side * speed < -SLACK * c.dry * response
    return fault


def solve_sticking(matrix, right, joints):
    """Solve the rows and columns of joints that stick, of a symmetric positive definite system.

    Both `matrix` and `right` are overwritten; `right` is then the solution, 0 for joints that
    slide.
    """
    n = right.size
    for i in range(n):
        if not joints[i].stuck:
            right[i] = 0.0
            continue
        for k in range(i + 1, n):
            if joints[k].stuck:
                factor = matrix[k, i] / matrix[i, i]
                right[k] -= factor * right[i]
                for j in range(i + 1, n):
                    matrix[k, j] -= factor * matrix[i, j]
    for back in range(n):
        i = n - 1 - back
        if joints[i].stuck:
            for j in range(i + 1, n):
                right[i] -= matrix[i, j] * right[j]
            right[i] /= matrix[i, i]


def stick_slip(response, joints, v_free, speed, side, force, matrix):
    """Solve the box problem of one robot: write v+ into `speed` and the friction torques.

    `response` is W; `stuck` holds a guess and then the answer. `side`, the directions of sliding,
    `force` and `matrix` are room to work in.
    """
    n = joints.size
    for j in range(n):
        side[j] = sign(v_free[j])
    last = BLOCK_ROUNDS + 20 * n
    rounds = 0
    going = True
    while going:
        for j in range(n):
            force[j] = v_free[j]
            for k in range(n):
                matrix[j, k] = response[j, k]
                if not joints[k].stuck:
                    force[j] -= response[j, k] * side[k] * joints[k].dry
        solve_sticking(matrix, force, joints)
        for j in range(n):
            if not joints[j].stuck:
                force[j] = side[j] * joints[j].dry
        at_fault = -1
        for j in range(n):
            speed[j] = 0.0
            if not joints[j].stuck:
                speed[j] = v_free[j]
                for k in range(n):
                    speed[j] -= response[j, k] * force[k]
            if is_at_fault(joints[j], speed[j], side[j], force[j], response[j, j]):
                at_fault = j
        going = at_fault >= 0 and rounds < last
        if going:
            for j in range(n):
                c = joints[j]
                # After a while only the last joint at fault: Murty's rule, which always ends.
                turn = rounds < BLOCK_ROUNDS or j == at_fault
                if turn and is_at_fault(c, speed[j], side[j], force[j], response[j, j]):
                    if c.stuck:
                        side[j] = sign(force[j])
                    c.stuck = 0 if c.stuck else 1
        rounds += 1
    for j in range(n):
        c = joints[j]
        c.friction = min(max(force[j], -c.dry), c.dry)
        if c.dry > 0.0 and side[j] * speed[j] < 0.0:
            speed[j] = 0.0


@kernel
def apply_dry_friction(factored, joints, v, workspace, h):
    """Turn the free speeds v of one robot into those that dry friction leaves, in place.

    First every joint is taken to slide on as it does; only where one would turn round is the box
    problem solved. `factored` is M + h F_v of the plant, as `factor_symmetric` left it, `workspace`
    as in `records.Plant`. Whether a joint sticks is a guess from the last step, then the answer.
    """
    n = v.size
    speed = workspace[0]
    for j in range(n):
        joints[j].friction = joints[j].dry * sign(v[j])
        speed[j] = joints[j].friction
    solve_symmetric(factored, speed)
    turns = False
    for j in range(n):
        c = joints[j]
        speed[j] = v[j] - h * speed[j]
        if c.dry > 0.0 and not sign(v[j]) * speed[j] > 0.0:
            turns = True
            c.stuck = 1
    if turns:
        response = workspace[WORKSPACE : WORKSPACE + n]
        for i in range(n):
            for j in range(n):
                response[i, j] = h if i == j else 0.0
            solve_symmetric(factored, response[i])
        matrix = workspace[WORKSPACE + n : WORKSPACE + 2 * n]
        stick_slip(response, joints, v, speed, workspace[1], workspace[2], matrix)
    for j in range(n):
        if not turns:
            joints[j].stuck = 0
        v[j] = speed[j]


@kernel
def apply_actuators(joints, q, v, torque, forces, motion, k, tau):
    """Clip the torques at the drives' limits, and record q, q' and torque as row k of `motion`.

    tau is then what turns the arm: the torque, what pushes from outside, and F_v q' against it.
    Returns whether a torque is not finite.
    """
    diverged = False
    for j in range(joints.size):
        c = joints[j]
        # Asked before the limits, which would hide it.
        diverged = diverged or not math.isfinite(torque[j])
        u = clip(torque[j], c.limit)
        motion[0, k, j] = q[j]
        motion[1, k, j] = v[j]
        motion[2, k, j] = u
        tau[j] = u + c.push - c.viscous * v[j] + forces[0, k, j]
    return diverged


@kernel
def integrate_velocity(v, a, h):
    """Take the first half of a step of semi-implicit Euler: v+ = v + h a."""
    for j in range(v.size):
        v[j] += h * a[j]


@kernel
def integrate_position(q, v, h):
    """Take its second half: q+ = q + h v+."""
    for j in range(q.size):
        q[j] += h * v[j]


@kernel
def runge_kutta_stage(joints, q, v, tau, stages, forces, k, i, h):
    """Write where stage i, 1 to 3, of the classical Runge-Kutta rule looks, and its torques.

    Rows of `stages`: angles, rates and torques of a stage; then for each of the four stages its
    rates and accelerations. The torques differ from those of the step's start in the disturbance
    and in F_v q'.
    """
    part = h if i == 3 else 0.5 * h
    at = 2 if i == 3 else 1
    for j in range(joints.size):
        stages[0, j] = q[j] + part * stages[1 + 2 * i, j]
        stages[1, j] = v[j] + part * stages[2 + 2 * i, j]
        change = forces[at, k, j] - forces[0, k, j]
        stages[2, j] = tau[j] + change - joints[j].viscous * (stages[1, j] - v[j])
        stages[3 + 2 * i, j] = stages[1, j]


@kernel
def finish_runge_kutta(q, v, stages, h):
    """Take the step from the slopes of all four stages."""
    for j in range(q.size):
        middle = 2.0 * stages[5, j] + 2.0 * stages[7, j]
        q[j] += h / 6.0 * (stages[3, j] + middle + stages[9, j])
        middle = 2.0 * stages[6, j] + 2.0 * stages[8, j]
        v[j] += h / 6.0 * (stages[4, j] + middle + stages[10, j])


@kernel
def runge_kutta(plant, forces, k, h):
    """Take a step of the classical Runge-Kutta rule, from the accelerations in `plant.a`."""
    stages = plant.workspace[WORKSPACE + 2 * plant.q.size :]
    for j in range(plant.q.size):
        stages[3, j] = plant.v[j]
        stages[4, j] = plant.a[j]
    for i in range(1, 4):
        runge_kutta_stage(plant.joints, plant.q, plant.v, plant.tau, stages, forces, k, i, h)
        forward_dynamics(
            plant.bodies, plant.frames, plant.gravity, stages[0], stages[1], stages[2], plant.mass,
            stages[4 + 2 * i],
        )  # fmt: skip
    finish_runge_kutta(plant.q, plant.v, stages, h)


def move(plant, has_dry_friction, forces, k, h):
    """Take a step with the torque held, by the compiled dynamics.

    Semi-implicit Euler with friction implicit, or Runge-Kutta where there are rows for its stages.
    """
    forward_dynamics(
        plant.bodies, plant.frames, plant.gravity, plant.q, plant.v, plant.tau, plant.mass, plant.a
    )
    if plant.workspace.shape[0] > WORKSPACE + 2 * plant.q.size:
        runge_kutta(plant, forces, k, h)
    else:
        integrate_velocity(plant.v, plant.a, h)
        if has_dry_friction:
            apply_dry_friction(plant.mass, plant.joints, plant.v, plant.workspace, h)
        integrate_position(plant.q, plant.v, h)


@kernel
def has_diverged(joints, q, v):
    """Return whether a joint has run away or lost its numbers."""
    diverged = False
    for j in range(joints.size):
        slow = abs(v[j]) <= joints[j].runaway
        diverged = diverged or not slow or not math.isfinite(q[j])
    return diverged
