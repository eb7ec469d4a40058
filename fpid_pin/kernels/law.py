"""The adaptive fractional PID of one robot: eqs. (10), (21), (22) and (30)-(32).

A trailing underscore is a value one sample ago; a record still holds it when a tick begins.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import clip, winds_up
from fpid_pin.kernels.operator import begin, derivative, moving
from fpid_pin.kernels.supervisor import lyapunov

#: A joint. Its description: gains at the start and their learning rates, sliding surface, scale,
#: effort limit, the supervisor's bound G_u + d_u; safeguards; orders (of D, so 1 - lambda and mu),
#: their learning rates and bounds. Then what changes; `u_m` is the model's part of the torque,
#: `v_hat` and `xi` the observer's speed and acceleration of unknown cause.
JOINT = layout(
    "kp_0 ki_0 kd_0 gamma_p gamma_i gamma_d k0 k1 scale limit bound viscous "
    "kp_min ki_min kd_min kp_max ki_max kd_max sigma nu dead_zone "
    "i_order_0 d_order_0 gamma_io gamma_do i_order_min i_order_max d_order_min d_order_max "
    "kp ki kd lam mu e e_dot int_e i_e d_e s u_fpid u_m u_s cut v_hat xi predicted"
)
#: A robot: its step. Its supervisor: P of (15), error dynamics k0 and k1 of (39), V_M of (16), a
#: boundary layer, V; where it is sampled: look-ahead, V_T, V_on, |z| and r. Its observer's gains.
#: Flags: regressors as printed, safeguards, orders that move, G_u is |G(q)| of the model, the
#: paper's supervisor acts, the sampled one does, the observer and the law have begun.
ROBOT = layout(
    "h p11 p12 p22 k0 k1 threshold layer value lookahead target trigger distance radius l1 l2",
    "printed guarded moves own_gravity acting pushing observing started",
)


@kernel(inline=True)
def leak(gain, initial, gamma, s, c):
    """Return the rate at which leakage pulls a gain, or an order, back to where it began."""
    return (c.sigma + c.nu * gamma * abs(s)) * (gain - initial)


@kernel(inline=True)
def bend(c, i_op, d_op, guarded, h):
    """Move a joint's orders by one step along the same gradient: alpha' = -gamma S s K dD/dalpha.

    The integral term's alpha is 1 - lambda, so lambda goes the other way, as it should. The slope
    is the one before that of S: a measured rate's noise is in S and in the slope of the same
    sample, and the mean of their product would drive mu upwards.
    """
    s = c.s
    i_leak = 0.0
    d_leak = 0.0
    if guarded:
        s -= clip(s, c.dead_zone)
        i_leak = leak(i_op.order, c.i_order_0, c.gamma_io, s, c)
        d_leak = leak(d_op.order, c.d_order_0, c.gamma_do, s, c)
    i_order = i_op.order - h * c.gamma_io * s * c.scale * c.ki * i_op.slope_ - h * i_leak
    d_order = d_op.order - h * c.gamma_do * s * c.scale * c.kd * d_op.slope_ - h * d_leak
    i_op.order = min(max(i_order, c.i_order_min), c.i_order_max)
    d_op.order = min(max(d_order, c.d_order_min), c.d_order_max)
    c.lam = 1.0 - i_op.order
    c.mu = d_op.order


@kernel(inline=True)
def adapt(c, printed, guarded, h):
    """Move a joint's gains by one step along the gradient of S^2/2, eqs. (30)-(32)."""
    s = c.s
    i_e = c.i_e
    d_e = c.d_e
    if printed:
        i_e = c.int_e
        d_e = c.e_dot
    p_leak = 0.0
    i_leak = 0.0
    d_leak = 0.0
    if guarded:
        s -= clip(s, c.dead_zone)
        p_leak = leak(c.kp, c.kp_0, c.gamma_p, s, c)
        i_leak = leak(c.ki, c.ki_0, c.gamma_i, s, c)
        d_leak = leak(c.kd, c.kd_0, c.gamma_d, s, c)
    c.kp -= h * c.gamma_p * s * c.e + h * p_leak  # (30)
    c.ki -= h * c.gamma_i * s * i_e + h * i_leak  # (31)
    c.kd -= h * c.gamma_d * s * d_e + h * d_leak  # (32)
    if guarded:
        c.kp = min(max(c.kp, c.kp_min), c.kp_max)
        c.ki = min(max(c.ki, c.ki_min), c.ki_max)
        c.kd = min(max(c.kd, c.kd_min), c.kd_max)


@kernel(inline=True)
def integral_step(e, e_, e_dot, e_dot_, h):
    """Return by how much int e grows over a step at whose ends e and e' are known."""
    return 0.5 * h * (e + e_) + h * h / 12.0 * (e_dot_ - e_dot)


@kernel(inline=True)
def fpid(robot, joints, ops, poles, modes, table, q, v, q_ref, v_ref, torque):
    """Make one tick: gains, errors, terms, torque, (n,); `ops` and `modes` are (n, 2, ...).

    `table`, of `operator.moving`, is only looked at where orders move.
    """
    h = robot.h
    # The gains move by the signals of the last tick, so that afterwards a record shows the gains
    # that made its torque. dK phi has the sign of -S: that is where adaptation pushes the torque.
    for j in range(joints.size):
        c = joints[j]
        if not robot.acting and not winds_up(c.cut, -c.s):
            if robot.moves:
                bend(c, ops[j, 0], ops[j, 1], robot.guarded, h)
            adapt(c, robot.printed, robot.guarded, h)
    robot.value = lyapunov(robot, q, v, q_ref, v_ref)  # (14)
    robot.acting = robot.value >= robot.threshold
    for j in range(joints.size):
        c = joints[j]
        e = q_ref[j] - q[j]
        e_dot = v_ref[j] - v[j]
        held = robot.acting or winds_up(c.cut, e)
        total = c.int_e
        i_op = ops[j, 0]
        d_op = ops[j, 1]
        # I^lambda e is D^(1 - lambda) of int e. The integrals may be held, the derivative must
        # follow the error.
        if not robot.started:
            c.i_e = begin(i_op, modes[j, 0], total, e)
            c.d_e = begin(d_op, modes[j, 1], e, e_dot)
        elif robot.moves:
            if not held:
                total += integral_step(e, c.e, e_dot, c.e_dot, h)
                c.i_e = moving(i_op, table, poles[0], modes[j, 0], total, c.int_e, e, c.e, h)
            c.d_e = moving(d_op, table, poles[0], modes[j, 1], e, c.e, e_dot, c.e_dot, h)
        else:
            if not held:
                total += integral_step(e, c.e, e_dot, c.e_dot, h)
                c.i_e = derivative(i_op, poles[i_op.row], modes[j, 0], total, c.int_e, e, c.e, h)
            c.d_e = derivative(d_op, poles[d_op.row], modes[j, 1], e, c.e, e_dot, c.e_dot, h)
        c.e = e
        c.e_dot = e_dot
        c.int_e = total
        c.s = -(e_dot + c.k1 * e + c.k0 * total)  # (22)
        c.u_fpid = c.scale * (c.kp * e + c.ki * c.i_e + c.kd * c.d_e)  # (10)
        c.u_s = 0.0
        torque[j] = clip(c.u_fpid, c.limit)
        c.cut = c.u_fpid - torque[j]
    robot.started = 1


@kernel
def fpids(alive, robots, joints, ops, poles, modes, table, inputs, torque):
    """Make a tick of every robot that is alive; return whether the supervisor of any acts."""
    acting = False
    for r in range(robots.size):
        if alive[r]:
            q, v, q_ref, v_ref = inputs[0, r], inputs[1, r], inputs[2, r], inputs[3, r]
            fpid(
                robots[r], joints[r], ops[r], poles, modes[r], table, q, v, q_ref, v_ref, torque[r]
            )
            acting = acting or robots[r].acting != 0
    return acting
