"""Dry friction of one robot over one step as a box problem: F_d after eq. (6).

Find v+ and the friction torque l with

    v+ = v_free - W l,  W = h M^-1,   |l_j| <= F_d,j,   l_j = F_d,j sgn(v+_j) where v+_j != 0

by block principal pivoting (Júdice and Pires, Computers & Operations Research 21, 1994): guess
which joints stick, solve, exchange those at fault, repeat.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.limits import sign
from fpid_pin.kernels.rigid_body import solve_tree

#: Relative slack of the conditions on friction and speed, well above rounding.
SLACK = 1e-12
#: Rounds in which every joint at fault changes sides; then one joint a round, which cannot cycle.
BLOCK_ROUNDS = 8


@kernel
def solve(matrix, right, chosen):
    """Solve the rows and columns that are `chosen` of a symmetric positive definite system.

    Both `matrix` and `right` are overwritten; `right` is then the solution, 0 where not chosen.
    """
    n = right.size
    for i in range(n):
        if not chosen[i]:
            right[i] = 0.0
            continue
        for k in range(i + 1, n):
            if chosen[k]:
                factor = matrix[k, i] / matrix[i, i]
                right[k] -= factor * right[i]
                for j in range(i + 1, n):
                    matrix[k, j] -= factor * matrix[i, j]
    for back in range(n):
        i = n - 1 - back
        if chosen[i]:
            for j in range(i + 1, n):
                right[i] -= matrix[i, j] * right[j]
            right[i] /= matrix[i, i]


@kernel
def apply_dry_friction(bodies, factored, dry, stuck, force, v, work, response, matrix, h):
    """Turn the free speeds v of one robot into those that dry friction leaves, in place.

    First every joint is taken to slide on as it does; only where one would turn round is the box
    problem solved.

    Parameters
    ----------
    bodies, factored
        Of the plant; M + h F_v as `factor_tree` left it.
    dry
        F_d, (n,) [N m].
    stuck
        Which joints stick, (n,): a guess from the last step, then the answer.
    force
        The friction torques, (n,) [N m].
    v
        Joint speeds, (n,) [rad/s].
    work, response, matrix
        Room to work in, (3, n) and twice (n, n).
    h
        Step [s].
    """
    n = v.size
    speed = work[0]
    for j in range(n):
        force[j] = dry[j] * sign(v[j])
        speed[j] = force[j]
    solve_tree(bodies, factored, speed)
    turns = False
    for j in range(n):
        speed[j] = v[j] - h * speed[j]
        against = dry[j] > 0.0 and not sign(v[j]) * speed[j] > 0.0
        turns = turns or against
        stuck[j] = against or stuck[j]
    if turns:
        for i in range(n):
            for j in range(n):
                response[i, j] = h if i == j else 0.0
            solve_tree(bodies, factored, response[i])
        stick_slip(response, dry, v, stuck, force, speed, work[1], work[2], matrix)
    for j in range(n):
        stuck[j] = turns and stuck[j]
        v[j] = speed[j]


@kernel
def stick_slip(response, dry, v_free, stuck, force, speed, side, fault, matrix):
    """Solve the box problem of one robot, (n,); `stuck` holds a guess and then the answer.

    `response` is W; `side`, `fault` and `matrix` are room to work in (`side` the direction of
    sliding, `fault` which joints have to change).
    """
    n = dry.size
    for j in range(n):
        side[j] = sign(v_free[j])
        stuck[j] = stuck[j] and dry[j] > 0.0
    last = BLOCK_ROUNDS + 20 * n
    rounds = 0
    going = True
    while going:
        for j in range(n):
            force[j] = v_free[j]
            for k in range(n):
                matrix[j, k] = response[j, k]
                if not stuck[k]:
                    force[j] -= response[j, k] * side[k] * dry[k]
        solve(matrix, force, stuck)
        at_fault = -1
        for j in range(n):
            if not stuck[j]:
                force[j] = side[j] * dry[j]
        for j in range(n):
            speed[j] = 0.0
            if not stuck[j]:
                speed[j] = v_free[j]
                for k in range(n):
                    speed[j] -= response[j, k] * force[k]
            # Speeds below this are zero: a rounding of what its own friction would do to it.
            still = -SLACK * dry[j] * response[j, j]
            breaks = stuck[j] and abs(force[j]) > dry[j] * (1.0 + SLACK)
            stops = dry[j] > 0.0 and side[j] * speed[j] < still
            fault[j] = breaks or stops
            if fault[j]:
                at_fault = j
        going = at_fault >= 0 and rounds < last
        if going:
            for j in range(n):
                # After a while only the last joint at fault: Murty's rule, which always ends.
                if fault[j] and (rounds < BLOCK_ROUNDS or j == at_fault):
                    if stuck[j]:
                        side[j] = sign(force[j])
                    stuck[j] = not stuck[j]
        rounds += 1
    for j in range(n):
        force[j] = min(max(force[j], -dry[j]), dry[j])
        if dry[j] > 0.0 and side[j] * speed[j] < 0.0:
            speed[j] = 0.0
