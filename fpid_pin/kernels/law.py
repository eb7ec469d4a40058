"""The adaptive fractional PID of one robot: eqs. (10), (21), (22) and (30)-(32).

A trailing underscore is a value one sample ago; a record still holds it when a tick begins.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import clip, winds_up
from fpid_pin.kernels.operator import begin, derivative
from fpid_pin.kernels.supervisor import lyapunov

#: A joint. Its description: gains at the start and their learning rates, sliding surface, scale,
#: effort limit, the supervisor's bound G_u + d_u; safeguards. Then what changes.
JOINT = layout(
    "kp_0 ki_0 kd_0 gamma_p gamma_i gamma_d k0 k1 scale limit bound "
    "kp_min ki_min kd_min kp_max ki_max kd_max sigma nu dead_zone "
    "kp ki kd e e_dot int_e i_e d_e s u_fpid u_s cut"
)
#: A robot: its step, and its supervisor: P = L L^T of (15), error dynamics k0 and k1 of (39), V_M
#: of (16), a boundary layer, V. Flags: regressors as printed, safeguards, G_u is |G(q)| of the
#: model, the supervisor acts, the law has begun.
ROBOT = layout(
    "h l11 l21 l22 p12 p22 k0 k1 threshold layer value",
    "printed guarded own_gravity acting started",
)


@kernel(inline=True)
def leak(gain, initial, gamma, s, c):
    """Return the rate at which leakage pulls a gain back to where it began."""
    return (c.sigma + c.nu * gamma * abs(s)) * (gain - initial)


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
def fpid(robot, joints, ops, poles, modes, q, v, q_ref, v_ref, torque):
    """One tick: gains, errors, terms, torque, (n,); `ops` and `modes` are (n, 2, ...)."""
    h = robot.h
    # The gains move by the signals of the last tick, so that afterwards a record shows the gains
    # that made its torque. dK phi has the sign of -S: that is where adaptation pushes the torque.
    for j in range(joints.size):
        c = joints[j]
        if not robot.acting and not winds_up(c.cut, -c.s):
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
        if robot.started:
            # I^lambda e is D^(1 - lambda) of int e. The integrals may be held, the derivative
            # must follow the error.
            if not held:
                total += integral_step(e, c.e, e_dot, c.e_dot, h)
                c.i_e = derivative(i_op, poles[i_op.row], modes[j, 0], total, c.int_e, e, c.e, h)
            c.d_e = derivative(d_op, poles[d_op.row], modes[j, 1], e, c.e, e_dot, c.e_dot, h)
        else:
            c.i_e = begin(i_op, modes[j, 0], total, e)
            c.d_e = begin(d_op, modes[j, 1], e, e_dot)
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
def fpids(alive, robots, joints, ops, poles, modes, inputs, torque):
    """One tick of every robot that is alive; return whether the supervisor of any acts."""
    acting = False
    for r in range(robots.size):
        if alive[r]:
            q, v, q_ref, v_ref = inputs[0, r], inputs[1, r], inputs[2, r], inputs[3, r]
            fpid(robots[r], joints[r], ops[r], poles, modes[r], q, v, q_ref, v_ref, torque[r])
            acting = acting or robots[r].acting != 0
    return acting
