"""Dry friction of one robot over one step as a box problem: F_d after eq. (6).

Find v+ and the friction torque l with

    v+ = v_free - W l,  W = h M^-1,   |l_j| <= F_d,j,   l_j = F_d,j sgn(v+_j) where v+_j != 0

by block principal pivoting (Júdice and Pires, Computers & Operations Research 21, 1994): guess
which joints stick, solve, exchange those at fault, repeat.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import sign
from fpid_pin.kernels.records import WORKSPACE
from fpid_pin.kernels.rigid_body import solve_symmetric

#: Relative slack of the conditions on friction and speed, well above rounding.
SLACK = 1e-12
#: Rounds in which every joint at fault changes sides; then one joint a round, which cannot cycle.
BLOCK_ROUNDS = 8


@kernel(inline=True)
def is_at_fault(c, speed, side, force, response):
    """Return whether a joint that sticks would break loose, or one that slides would turn round."""
    if c.stuck:
        fault = abs(force) > c.dry * (1.0 + SLACK)
    else:
        # Speeds below this are zero: a rounding of what its own friction would do to it.
        fault = c.dry > 0.0 and side * speed < -SLACK * c.dry * response
    return fault


@kernel(inline=True)
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


@kernel(inline=True)
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
