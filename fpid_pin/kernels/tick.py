"""One tick of a controller, for every law: signals, what the model says, torques, adaptation.

The order is that of the equations: errors and the observer; V (14) and whether the paper's
supervisor acts, which holds integrals and gains; operators of given signals; the law's surface;
operators of its signals; the model; the law's torque; feedforward, what cancels a disturbance,
supervisor; the effort limit; the observer's prediction. Then the torque is applied and recorded,
and the law adapts.

A law's functions are called by address (`kernels.call`); 0 stands for none. The arrays of a
controller c are those of `records.Controller`.
"""

from __future__ import annotations

from fpid_pin.kernels import newton_euler
from fpid_pin.kernels.call import call_law
from fpid_pin.kernels.compiled import compile_plain, kernel
from fpid_pin.kernels.limits import clip, winds_up
from fpid_pin.kernels.observer import correct_observer, predict
from fpid_pin.kernels.operator import advance_operator
from fpid_pin.kernels.records import (
    ACCELERATION,
    BIAS,
    CHANGE,
    CORIOLIS,
    FEEDFORWARD,
    GRAVITY,
    INERTIA,
    LAW_TERM,
    WORK,
    WORK_2,
    WORK_3,
)
from fpid_pin.kernels.rigid_body import (
    factor_tree,
    mass_matrix_and_bias,
    set_base_acceleration,
    solve_tree,
)
from fpid_pin.kernels.supervisor import (
    energy,
    error_terms,
    find_push,
    least_correction,
    paper_torque,
)

inverse_dynamics = compile_plain(newton_euler.inverse_dynamics)
velocities = compile_plain(newton_euler.velocities)
gradient = compile_plain(newton_euler.gradient)


@kernel
def integral_step(e, e_, e_dot, e_dot_, h):
    """Return by how much int e grows over a step at whose ends e and e' are known."""
    return 0.5 * h * (e + e_) + h * h / 12.0 * (e_dot_ - e_dot)


@kernel(inline=True)
def load_errors(c, inputs):
    """Take a sample: measured q, v and the reference's q, v, a, (5, n); errors, V and int e."""
    robot = c.robot[0]
    t = robot.h * robot.ticks
    value = 0.0
    if robot.supervised:
        for j in range(c.joints.size):
            value += energy(robot, inputs[2, j] - inputs[0, j], inputs[3, j] - inputs[1, j])
    robot.value = value
    robot.acting = 1 if value >= robot.threshold else 0
    for j in range(c.joints.size):
        g = c.joints[j]
        e = inputs[2, j] - inputs[0, j]
        e_dot = inputs[3, j] - inputs[1, j]
        if robot.ticks > 0 and not robot.acting and not winds_up(g.cut, e):
            g.int_e += integral_step(e, g.e, e_dot, g.e_dot, robot.h)
        g.t = t
        g.q, g.v = inputs[0, j], inputs[1, j]
        g.q_ref, g.v_ref, g.a_ref = inputs[2, j], inputs[3, j], inputs[4, j]
        g.e, g.e_dot = e, e_dot
        g.lyapunov = value


@kernel(inline=True)
def advance_operators(c, first, last):
    """Take one sample of operators `first` to `last` - 1 of each joint."""
    robot = c.robot[0]
    for j in range(c.joints.size):
        for i in range(first, last):
            op = c.ops[j, i]
            advance_operator(
                op, c.table, c.poles[op.row], c.modes[j, i], c.numbers[j], robot.ticks > 0,
                robot.acting != 0, c.joints[j].cut, robot.h,
            )  # fmt: skip


@kernel(inline=True)
def signals(c, inputs):
    """Make the first part of a tick: all that comes before the model is asked."""
    robot = c.robot[0]
    load_errors(c, inputs)
    correct_observer(robot, c.joints)
    if robot.first_operators > 0:
        advance_operators(c, 0, robot.first_operators)
    if robot.surface != 0:
        call_law(robot.surface, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    if robot.first_operators < c.ops.shape[1]:
        advance_operators(c, robot.first_operators, c.ops.shape[1])


@kernel
def mass_times(bodies, mass, x, out):
    """Write M x, (n,), of the lower half of M; joints that do not carry each other have no entry."""
    n = bodies.size
    for i in range(n):
        out[i] = mass[i, i] * x[i]
    for i in range(n):
        k = bodies[i].parent
        while k < n:
            out[i] += mass[i, k] * x[k]
            out[k] += mass[i, k] * x[i]
            k = bodies[k].parent


@kernel(inline=True)
def ask_model(c, inputs):
    """Write what the nominal model says of this sample into `terms` and `mass`, as asked for."""
    robot, terms = c.robot[0], c.terms
    n = c.joints.size
    if robot.declares:
        # M a + C(q, v) w + G of the law's a and w.
        w, a = terms[WORK], terms[WORK_2]
        for j in range(n):
            w[j] = c.joints[j].w
            a[j] = c.joints[j].a
        inertias = c.numbers[:, robot.inertia : robot.inertia + 10]
        inverse_dynamics(
            c.bodies, inertias, c.links, c.motions, c.gravity, inputs[0], inputs[1], w, a,
            terms[LAW_TERM],
        )  # fmt: skip
    if robot.feedforward:
        inverse_dynamics(
            c.bodies, c.numbers[:, INERTIA : INERTIA + 10], c.links, c.motions, c.gravity,
            inputs[2], inputs[3], inputs[3], inputs[4], terms[FEEDFORWARD],
        )  # fmt: skip
    if robot.paper and robot.acting:
        speed = terms[WORK]
        for j in range(n):
            speed[j] = 0.0
        set_base_acceleration(c.frames, n, c.gravity)
        mass_matrix_and_bias(c.bodies, c.frames, inputs[0], speed, terms[GRAVITY], c.mass)
        mass_matrix_and_bias(c.bodies, c.frames, inputs[0], inputs[1], terms[CORIOLIS], c.mass)
        for j in range(n):
            terms[CORIOLIS, j] -= terms[GRAVITY, j]
    if robot.observes or robot.sampled:
        speed = terms[WORK]
        for j in range(n):
            speed[j] = c.joints[j].v_hat
        set_base_acceleration(c.frames, n, c.gravity)
        mass_matrix_and_bias(c.bodies, c.frames, inputs[0], speed, terms[BIAS], c.mass)


@kernel(inline=True)
def limit_torque(c, torque):
    """Write the torque asked for, clipped at the effort limits, and by how much it was cut."""
    for j in range(c.joints.size):
        g = c.joints[j]
        asked = g.u_law + g.u_model + g.u_s
        torque[j] = clip(asked, g.limit)
        g.cut = asked - torque[j]


@kernel(inline=True)
def nominal_acceleration(c, torque):
    """Write what the model makes of a torque: M^-1 (u - F_v v^ - C v^ - G)."""
    a = c.terms[ACCELERATION]
    for j in range(c.joints.size):
        g = c.joints[j]
        a[j] = torque[j] - g.viscous * g.v_hat - c.terms[BIAS, j]
    solve_tree(c.bodies, c.factored, a)


@kernel(inline=True)
def sampled_supervisor(c, torque):
    """Add u_s of the supervisor for sampled loops, M times the least change of acceleration."""
    robot, terms = c.robot[0], c.terms
    n = c.joints.size
    change, reserve, u_s = terms[CHANGE], terms[WORK], terms[WORK_2]
    find_push(robot, c.joints, terms[ACCELERATION], change)
    if robot.pushing:
        for j in range(n):
            reserve[j] = change[j]
        solve_tree(c.bodies, c.factored, reserve)
        least_correction(robot, c.joints, reserve, change)
    if robot.pushing:
        mass_times(c.bodies, c.mass, change, u_s)
        cut = False
        for j in range(n):
            g = c.joints[j]
            terms[WORK_3, j] = torque[j]
            g.u_s = u_s[j]
            asked = g.u_law + g.u_model + g.u_s
            torque[j] = clip(asked, g.limit)
            g.cut = asked - torque[j]
            cut = cut or g.cut != 0.0
        if robot.observes and cut:
            # The effort limit left less of the change.
            for j in range(n):
                change[j] = torque[j] - terms[WORK_3, j]
            solve_tree(c.bodies, c.factored, change)


@kernel(inline=True)
def paper_supervisor(c, torque):
    """Add u_s of (20) while V >= V_M."""
    robot, terms = c.robot[0], c.terms
    n = c.joints.size
    demand, w, product = terms[WORK], terms[WORK_2], terms[WORK_3]
    error_terms(robot, c.joints, demand, w)
    solve_tree(c.bodies, c.factored, w)
    mass_times(c.bodies, c.mass, demand, product)
    for j in range(n):
        demand[j] = c.joints[j].a_ref
    feedforward = terms[CHANGE]
    mass_times(c.bodies, c.mass, demand, feedforward)
    paper_torque(robot, c.joints, terms[GRAVITY], terms[CORIOLIS], product, feedforward, w)
    for j in range(n):
        feedforward[j] = 0.0
    limit_torque(c, torque)


@kernel(inline=True)
def torques(c, torque):
    """Make the second part of a tick: write the torque, (n,), within the effort limits."""
    robot, terms = c.robot[0], c.terms
    n = c.joints.size
    if robot.torque != 0:
        call_law(robot.torque, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    for j in range(n):
        g = c.joints[j]
        g.u_model = terms[LAW_TERM, j] if robot.declares else 0.0
        if robot.feedforward:
            g.u_model += terms[FEEDFORWARD, j] + g.viscous * g.v_ref
        g.u_s = 0.0
    if robot.compensates:
        found, lost = terms[WORK], terms[WORK_2]
        for j in range(n):
            found[j] = c.joints[j].xi
        mass_times(c.bodies, c.mass, found, lost)
        for j in range(n):
            c.joints[j].u_model -= lost[j]
    limit_torque(c, torque)
    acts = robot.paper and robot.acting
    if robot.observes or robot.sampled or acts:
        for i in range(n):
            for k in range(i + 1):
                c.factored[i, k] = c.mass[i, k]
        factor_tree(c.bodies, c.factored)
    if robot.sampled:
        nominal_acceleration(c, torque)
        sampled_supervisor(c, torque)
    elif acts:
        paper_supervisor(c, torque)
    if robot.observes:
        if not robot.sampled:
            nominal_acceleration(c, torque)
        predict(robot, c.joints, terms[ACCELERATION], terms[CHANGE])


@kernel(inline=True)
def derivatives_by_inertia(c):
    """Write the derivatives of S . tau by the inertial numbers that the law estimates.

    A joint whose torque was cut tells nothing about them while adapting to it would ask for more
    torque yet: its S counts as 0.
    """
    surface = c.terms[WORK]
    for j in range(c.joints.size):
        g = c.joints[j]
        surface[j] = 0.0 if winds_up(g.cut, -g.s) else g.s
    velocities(c.bodies, c.links, surface, c.motions[2])
    first = c.robot[0].inertia + 10
    gradient(c.links, c.motions, c.numbers[:, first : first + 10])


@kernel(inline=True)
def adapt(c):
    """Let the law adapt by the signals of this tick, unless the paper's supervisor holds it."""
    robot = c.robot[0]
    if robot.adapt != 0 and not robot.acting:
        if robot.estimates:
            derivatives_by_inertia(c)
        call_law(robot.adapt, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    robot.ticks += 1


@kernel(inline=True)
def tick(c, inputs, torque):
    """Make a tick up to its torque, (n,), for `inputs`, (5, n): see `load_errors`."""
    signals(c, inputs)
    ask_model(c, inputs)
    torques(c, torque)
