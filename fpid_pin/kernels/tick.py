"""One tick of a controller, for every law: signals, what the model says, torques, adaptation.

The order is that of the equations: errors and the observer; V (14) and whether the paper's
supervisor acts, which holds integrals and gains; operators of given signals; the law's surface;
operators of its signals; the model; the law's torque; feedforward, what cancels a disturbance,
supervisor; the effort limit; the observer's prediction. Then the torque is applied and recorded,
and the law adapts.

A law's functions are called by address (`compiled.call_law`); 0 stands for none. The arrays of a
controller c are those of `records.Controller`.
"""

from __future__ import annotations

from fpid_pin.kernels import newton_euler
from fpid_pin.kernels.compiled import call_law, kernel
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
    factor_symmetric,
    solve_symmetric,
    survey,
)
from fpid_pin.kernels.supervisor import (
    energy,
    error_terms,
    find_push,
    least_correction,
    paper_torque,
)

inverse_dynamics = kernel(newton_euler.inverse_dynamics)
velocities = kernel(newton_euler.velocities)
gradient = kernel(newton_euler.gradient)
gravity_torques = kernel(newton_euler.gravity_torques)


@kernel(inline=True)
def integral_step(e, e_, e_dot, e_dot_, h):
    """Return by how much int e grows over a step at whose ends e and e' are known."""
    return 0.5 * h * (e + e_) + h * h / 12.0 * (e_dot_ - e_dot)


@kernel
def load_errors(robot, joints, inputs):
    """Take a sample: measured q, v and the reference's q, v, a, (5, n); errors, V and int e."""
    t = robot.h * robot.ticks
    value = 0.0
    if robot.supervised:
        for j in range(joints.size):
            value += energy(robot, inputs[2, j] - inputs[0, j], inputs[3, j] - inputs[1, j])
    robot.acting = 1 if value >= robot.threshold else 0
    for j in range(joints.size):
        g = joints[j]
        e = inputs[2, j] - inputs[0, j]
        e_dot = inputs[3, j] - inputs[1, j]
        if robot.ticks > 0 and not robot.acting and not winds_up(g.cut, e):
            g.int_e += integral_step(e, g.e, e_dot, g.e_dot, robot.h)
        g.t = t
        g.q, g.v = inputs[0, j], inputs[1, j]
        g.q_ref, g.v_ref, g.a_ref = inputs[2, j], inputs[3, j], inputs[4, j]
        g.e, g.e_dot = e, e_dot
        g.lyapunov = value


@kernel
def advance_operators(robot, joints, numbers, ops, poles, modes, table, first, last):
    """Take one sample of each joint's operators from number `first` to before `last`."""
    for j in range(joints.size):
        for i in range(first, last):
            op = ops[j, i]
            advance_operator(
                op, table, poles[op.row], modes[j, i], numbers[j], robot.ticks > 0,
                robot.acting != 0, joints[j].cut, robot.h,
            )  # fmt: skip


@kernel(inline=True)
def signals(c, inputs):
    """Make the first part of a tick: all that comes before the model is asked."""
    robot = c.robot[0]
    load_errors(robot, c.joints, inputs)
    correct_observer(robot, c.joints)
    count = c.ops.shape[1]
    given = robot.first_operators
    if given > 0:
        advance_operators(robot, c.joints, c.numbers, c.ops, c.poles, c.modes, c.table, 0, given)
    if robot.surface != 0:
        call_law(robot.surface, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    if given < count:
        advance_operators(
            robot, c.joints, c.numbers, c.ops, c.poles, c.modes, c.table, given, count
        )


@kernel
def mass_times(mass, x, out):
    """Write M x, (n,), from the lower half of M."""
    for i in range(x.size):
        out[i] = mass[i, i] * x[i]
        for k in range(i):
            out[i] += mass[i, k] * x[k]
            out[k] += mass[i, k] * x[i]


@kernel(inline=True)
def ask_model(c, inputs):
    """Write what the nominal model says of this sample into `terms` and `mass`, as asked for."""
    robot, terms = c.robot[0], c.terms
    n = c.joints.size
    if robot.declares and robot.surface == 0:
        # Nothing writes a and w, so that G is all there is.
        gravity_torques(
            c.bodies, c.numbers[:, robot.inertia : robot.inertia + 10], c.links, c.gravity,
            inputs[0], terms[LAW_TERM],
        )  # fmt: skip
    elif robot.declares:
        # M a + C(q, v) w + G of the law's a and w.
        w, a = terms[WORK], terms[WORK_2]
        for j in range(n):
            w[j] = c.joints[j].w
            a[j] = c.joints[j].a
        inverse_dynamics(
            c.bodies, c.numbers[:, robot.inertia : robot.inertia + 10], c.links, c.motions,
            c.gravity, inputs[0], inputs[1], w, a, terms[LAW_TERM],
        )  # fmt: skip
    if robot.feedforward:
        inverse_dynamics(
            c.bodies, c.numbers[:, INERTIA : INERTIA + 10], c.links, c.motions, c.gravity,
            inputs[2], inputs[3], inputs[3], inputs[4], terms[FEEDFORWARD],
        )  # fmt: skip
    if robot.paper and robot.acting:
        gravity_torques(
            c.bodies, c.numbers[:, INERTIA : INERTIA + 10], c.links, c.gravity, inputs[0],
            terms[GRAVITY],
        )  # fmt: skip
        survey(c.bodies, c.frames, c.gravity, inputs[0], inputs[1], terms[CORIOLIS], c.mass)
        for j in range(n):
            terms[CORIOLIS, j] -= terms[GRAVITY, j]
    if robot.observes or robot.sampled:
        speed = terms[WORK]
        for j in range(n):
            speed[j] = c.joints[j].v_hat
        survey(c.bodies, c.frames, c.gravity, inputs[0], speed, terms[BIAS], c.mass)


@kernel
def limit_torque(joints, torque):
    """Write the torque asked for, clipped at the effort limits, and by how much it was cut."""
    cut = False
    for j in range(joints.size):
        g = joints[j]
        asked = g.u_law + g.u_model + g.u_s
        torque[j] = clip(asked, g.limit)
        g.cut = asked - torque[j]
        cut = cut or g.cut != 0.0
    return cut


@kernel
def torque_of_change(joints, mass, h, x, out):
    """Write (M + h F_v) x, the torque that changes the accelerations of a step by x, (n,)."""
    mass_times(mass, x, out)
    for j in range(joints.size):
        out[j] += h * joints[j].viscous * x[j]


@kernel
def nominal_acceleration(joints, factored, terms, torque):
    """Write what the model makes of a torque: (M + h F_v)^-1 (u - F_v v - C v^ - G).

    Viscous friction is implicit in the speed, as in the arm's motion: taken from the start of a
    step alone, friction that stops a joint within the step would seem to reverse it. Its v is the
    measured one, so that the observer's poles are p whatever friction.
    """
    a = terms[ACCELERATION]
    for j in range(joints.size):
        g = joints[j]
        a[j] = torque[j] - g.viscous * g.v - terms[BIAS, j]
    solve_symmetric(factored, a)


@kernel
def sampled_supervisor(robot, joints, mass, factored, terms, torque):
    """Add u_s of the supervisor for sampled loops, the torque of the least change that is wanted.

    `factored` are the factors of M + h F_v.
    """
    n = joints.size
    change, reserve, u_s = terms[CHANGE], terms[WORK], terms[WORK_2]
    find_push(robot, joints, terms[ACCELERATION], change)
    if robot.pushing:
        for j in range(n):
            reserve[j] = change[j]
        solve_symmetric(factored, reserve)
        least_correction(robot, joints, reserve, change)
    if robot.pushing:
        torque_of_change(joints, mass, robot.h, change, u_s)
        for j in range(n):
            terms[WORK_3, j] = torque[j]
            joints[j].u_s = u_s[j]
        if limit_torque(joints, torque) and robot.observes:
            # The effort limit left less of the change.
            for j in range(n):
                change[j] = torque[j] - terms[WORK_3, j]
            solve_symmetric(factored, change)


@kernel
def paper_supervisor(robot, joints, mass, factored, terms, torque):
    """Add u_s of (20) while V >= V_M."""
    n = joints.size
    demand, w, product, feedforward = terms[WORK], terms[WORK_2], terms[WORK_3], terms[CHANGE]
    error_terms(robot, joints, demand, w)
    solve_symmetric(factored, w)
    mass_times(mass, demand, product)
    for j in range(n):
        demand[j] = joints[j].a_ref
    mass_times(mass, demand, feedforward)
    paper_torque(robot, joints, terms[GRAVITY], terms[CORIOLIS], product, feedforward, w)
    for j in range(n):
        feedforward[j] = 0.0
    limit_torque(joints, torque)


@kernel
def add_model_terms(robot, joints, mass, terms):
    """Write what the model adds: the law's own term, feedforward, less what cancels xi."""
    found, lost = terms[WORK], terms[WORK_2]
    for j in range(joints.size):
        g = joints[j]
        g.u_s = 0.0
        g.u_model = terms[LAW_TERM, j] if robot.declares else 0.0
        if robot.feedforward:
            g.u_model += terms[FEEDFORWARD, j] + g.viscous * g.v_ref
        found[j] = g.xi
    if robot.compensates:
        torque_of_change(joints, mass, robot.h, found, lost)
        for j in range(joints.size):
            joints[j].u_model -= lost[j]


@kernel
def factor_mass(joints, mass, h, factored):
    """Write the factors of M + h F_v and leave M as it is; h = 0: of M alone."""
    for i in range(joints.size):
        for k in range(i + 1):
            factored[i, k] = mass[i, k]
        factored[i, i] += h * joints[i].viscous
    factor_symmetric(factored)


@kernel(inline=True)
def torques(c, torque):
    """Make the second part of a tick: write the torque, (n,), within the effort limits."""
    robot = c.robot[0]
    if robot.torque != 0:
        call_law(robot.torque, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    add_model_terms(robot, c.joints, c.mass, c.terms)
    limit_torque(c.joints, torque)
    if robot.sampled:
        factor_mass(c.joints, c.mass, robot.h, c.factored)
        nominal_acceleration(c.joints, c.factored, c.terms, torque)
        sampled_supervisor(robot, c.joints, c.mass, c.factored, c.terms, torque)
    elif robot.paper and robot.acting:
        # (20) is of continuous time, and so is its M.
        factor_mass(c.joints, c.mass, 0.0, c.factored)
        paper_supervisor(robot, c.joints, c.mass, c.factored, c.terms, torque)
    if robot.observes:
        if not robot.sampled:
            factor_mass(c.joints, c.mass, robot.h, c.factored)
            nominal_acceleration(c.joints, c.factored, c.terms, torque)
        predict(robot, c.joints, c.terms[ACCELERATION], c.terms[CHANGE])


@kernel(inline=True)
def mask_surface(joints, out):
    """Write S of each joint, 0 where its torque was cut and adapting would ask for more yet."""
    for j in range(joints.size):
        g = joints[j]
        out[j] = 0.0 if winds_up(g.cut, -g.s) else g.s


@kernel(inline=True)
def adapt(c):
    """Let the law adapt by the signals of this tick, unless the paper's supervisor holds it."""
    robot = c.robot[0]
    if robot.adapt != 0 and not robot.acting:
        if robot.estimates:
            # The derivatives of S . tau by the inertial numbers that the law estimates.
            mask_surface(c.joints, c.terms[WORK])
            velocities(c.bodies, c.links, c.terms[WORK], c.motions[2])
            first = robot.inertia + 10
            gradient(c.links, c.motions, c.numbers[:, first : first + 10])
        call_law(robot.adapt, c.numbers, c.own, c.bodies, c.links, c.motions, c.gravity)
    robot.ticks += 1


@kernel
def tick_parts(c, inputs, torque, parts):
    """Make a tick, for `inputs`, (5, n): see `load_errors`; write its torque, (n,).

    `parts` is the sum of those that are wanted: 8 adaptation by the tick before, 1 the signals, 2
    the model by the compiled dynamics, 4 the torques.
    """
    if parts & 8:
        adapt(c)
    if parts & 1:
        signals(c, inputs)
    if parts & 2:
        ask_model(c, inputs)
    if parts & 4:
        torques(c, torque)
