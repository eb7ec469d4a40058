"""One tick of a controller, for every law: signals, what the model says, torques, adaptation.

The order is that of the equations: errors and the observer; V (14) and whether the paper's
supervisor acts, which holds integrals and gains; operators of given signals; the law's surface;
operators of its signals; the model; the law's torque; feedforward, what cancels a disturbance,
supervisor; the effort limit; the observer's prediction. Then the torque is applied and recorded,
and the law adapts.

To read it, begin at the end, with `tick_parts`. `ctrl` are all arrays of one robot's controller
(`records.Controller`); `c` is one joint's record, as in a law. A law's functions are called by
address (`compiled.call_law`); 0 stands for none.
"""

from fpid_pin.kernels import newton_euler
from fpid_pin.kernels.compiled import call_law, kernel
from fpid_pin.kernels.functions import clip, winds_up
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
    mass_matrix_and_bias,
    solve_symmetric,
)
from fpid_pin.kernels.supervisor import (
    correct_observer,
    energy,
    error_terms,
    find_correction,
    least_correction,
    paper_torque,
    predict,
)

inverse_dynamics = kernel(newton_euler.inverse_dynamics)
velocities = kernel(newton_euler.velocities)
gradient = kernel(newton_euler.gradient)
gravity_torques = kernel(newton_euler.gravity_torques)


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
        c = joints[j]
        e = inputs[2, j] - inputs[0, j]
        e_dot = inputs[3, j] - inputs[1, j]
        if robot.ticks > 0 and not robot.acting and not winds_up(c.cut, e):
            c.int_e += integral_step(e, c.e, e_dot, c.e_dot, robot.h)
        c.t = t
        c.q, c.v = inputs[0, j], inputs[1, j]
        c.q_ref, c.v_ref, c.a_ref = inputs[2, j], inputs[3, j], inputs[4, j]
        c.e, c.e_dot = e, e_dot
        c.lyapunov = value


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


def signals(ctrl, inputs):
    """Make the first part of a tick: all that comes before the model is asked."""
    robot = ctrl.robot[0]
    load_errors(robot, ctrl.joints, inputs)
    correct_observer(robot, ctrl.joints)
    count = ctrl.ops.shape[1]
    given = robot.first_operators
    if given > 0:
        advance_operators(
            robot, ctrl.joints, ctrl.numbers, ctrl.ops, ctrl.poles, ctrl.modes, ctrl.table, 0, given
        )
    if robot.surface != 0:
        call_law(robot.surface, ctrl)
    if given < count:
        advance_operators(
            robot, ctrl.joints, ctrl.numbers, ctrl.ops, ctrl.poles, ctrl.modes, ctrl.table, given,
            count,
        )  # fmt: skip


@kernel
def mass_times(mass, x, out):
    """Write M x, (n,), from the lower half of M."""
    for i in range(x.size):
        out[i] = mass[i, i] * x[i]
        for k in range(i):
            out[i] += mass[i, k] * x[k]
            out[k] += mass[i, k] * x[i]


def evaluate_model(ctrl, inputs):
    """Write what the nominal model says of this sample into `terms` and `mass`, as asked for."""
    robot, terms = ctrl.robot[0], ctrl.terms
    n = ctrl.joints.size
    if robot.uses_model and robot.surface == 0:
        # Nothing writes a and w, so that G is all there is.
        gravity_torques(
            ctrl.bodies, ctrl.numbers[:, robot.inertia : robot.inertia + 10], ctrl.links,
            ctrl.gravity, inputs[0], terms[LAW_TERM],
        )  # fmt: skip
    elif robot.uses_model:
        # M a + C(q, v) w + G of the law's a and w.
        w, a = terms[WORK], terms[WORK_2]
        for j in range(n):
            w[j] = ctrl.joints[j].w
            a[j] = ctrl.joints[j].a
        inverse_dynamics(
            ctrl.bodies, ctrl.numbers[:, robot.inertia : robot.inertia + 10], ctrl.links,
            ctrl.motions, ctrl.gravity, inputs[0], inputs[1], w, a, terms[LAW_TERM],
        )  # fmt: skip
    if robot.feedforward:
        inverse_dynamics(
            ctrl.bodies, ctrl.numbers[:, INERTIA : INERTIA + 10], ctrl.links, ctrl.motions,
            ctrl.gravity, inputs[2], inputs[3], inputs[3], inputs[4], terms[FEEDFORWARD],
        )  # fmt: skip
    if robot.paper and robot.acting:
        gravity_torques(
            ctrl.bodies, ctrl.numbers[:, INERTIA : INERTIA + 10], ctrl.links, ctrl.gravity,
            inputs[0], terms[GRAVITY],
        )  # fmt: skip
        mass_matrix_and_bias(
            ctrl.bodies, ctrl.frames, ctrl.gravity, inputs[0], inputs[1], terms[CORIOLIS], ctrl.mass
        )
        for j in range(n):
            terms[CORIOLIS, j] -= terms[GRAVITY, j]
    if robot.observes or robot.sampled:
        speed = terms[WORK]
        for j in range(n):
            speed[j] = ctrl.joints[j].v_hat
        mass_matrix_and_bias(
            ctrl.bodies, ctrl.frames, ctrl.gravity, inputs[0], speed, terms[BIAS], ctrl.mass
        )


@kernel
def limit_torque(joints, torque):
    """Write the torque asked for, clipped at the effort limits, and by how much it was cut."""
    for j in range(joints.size):
        c = joints[j]
        asked = c.u_law + c.u_model + c.u_s
        torque[j] = clip(asked, c.limit)
        c.cut = asked - torque[j]


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
        c = joints[j]
        a[j] = torque[j] - c.viscous * c.v - terms[BIAS, j]
    solve_symmetric(factored, a)


@kernel
def sampled_supervisor(robot, joints, mass, factored, terms, torque):
    """Add u_s of the supervisor for sampled loops, the torque of the least change that is wanted.

    `factored` are the factors of M + h F_v.
    """
    n = joints.size
    change, reserve, u_s = terms[CHANGE], terms[WORK], terms[WORK_2]
    find_correction(robot, joints, terms[ACCELERATION], change)
    if robot.correcting:
        for j in range(n):
            reserve[j] = change[j]
        solve_symmetric(factored, reserve)
        least_correction(robot, joints, reserve, change)
    if robot.correcting:
        torque_of_change(joints, mass, robot.h, change, u_s)
        cut = False
        for j in range(n):
            # On top of what the effort limit left, for which the change was found.
            c = joints[j]
            terms[WORK_3, j] = torque[j]
            c.u_s = u_s[j]
            asked = torque[j] + c.u_s
            torque[j] = clip(asked, c.limit)
            c.cut += asked - torque[j]
            cut = cut or asked != torque[j]
        if cut and robot.observes:
            # The effort limit left less of the change.
            for j in range(n):
                change[j] = torque[j] - terms[WORK_3, j]
            solve_symmetric(factored, change)


@kernel
def paper_supervisor(robot, joints, mass, factored, terms, torque):
    """Add u_s of (20) while V >= V_M; `factored` are the factors of M."""
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
    xi, torque = terms[WORK], terms[WORK_2]
    for j in range(joints.size):
        c = joints[j]
        c.u_s = 0.0
        c.u_model = terms[LAW_TERM, j] if robot.uses_model else 0.0
        if robot.feedforward:
            c.u_model += terms[FEEDFORWARD, j] + c.viscous * c.v_ref
        xi[j] = c.xi
    if robot.compensates:
        torque_of_change(joints, mass, robot.h, xi, torque)
        for j in range(joints.size):
            joints[j].u_model -= torque[j]


@kernel
def factor_mass(joints, mass, h, factored):
    """Write the factors of M + h F_v and leave M as it is; h = 0: of M alone."""
    for i in range(joints.size):
        for k in range(i + 1):
            factored[i, k] = mass[i, k]
        factored[i, i] += h * joints[i].viscous
    factor_symmetric(factored)


def torques(ctrl, torque):
    """Make the second part of a tick: write the torque, (n,), within the effort limits."""
    robot = ctrl.robot[0]
    if robot.torque != 0:
        call_law(robot.torque, ctrl)
    add_model_terms(robot, ctrl.joints, ctrl.mass, ctrl.terms)
    limit_torque(ctrl.joints, torque)
    if robot.sampled:
        factor_mass(ctrl.joints, ctrl.mass, robot.h, ctrl.factored)
        nominal_acceleration(ctrl.joints, ctrl.factored, ctrl.terms, torque)
        sampled_supervisor(robot, ctrl.joints, ctrl.mass, ctrl.factored, ctrl.terms, torque)
    elif robot.paper and robot.acting:
        # (20) is of continuous time, and so is its M.
        factor_mass(ctrl.joints, ctrl.mass, 0.0, ctrl.factored)
        paper_supervisor(robot, ctrl.joints, ctrl.mass, ctrl.factored, ctrl.terms, torque)
    if robot.observes:
        if not robot.sampled:
            factor_mass(ctrl.joints, ctrl.mass, robot.h, ctrl.factored)
            nominal_acceleration(ctrl.joints, ctrl.factored, ctrl.terms, torque)
        predict(robot, ctrl.joints, ctrl.terms[ACCELERATION], ctrl.terms[CHANGE])


def mask_surface(joints, out):
    """Write S of each joint, 0 where its torque was cut and adapting would ask for more yet."""
    for j in range(joints.size):
        c = joints[j]
        out[j] = 0.0 if winds_up(c.cut, -c.s) else c.s


def adapt(ctrl):
    """Let the law adapt by the signals of this tick, unless the paper's supervisor holds it."""
    robot = ctrl.robot[0]
    if robot.adapt != 0 and not robot.acting:
        if robot.estimates:
            # The derivatives of S . tau by the inertial numbers that the law estimates.
            mask_surface(ctrl.joints, ctrl.terms[WORK])
            velocities(ctrl.bodies, ctrl.links, ctrl.terms[WORK], ctrl.motions[2])
            first = robot.inertia + 10
            gradient(ctrl.links, ctrl.motions, ctrl.numbers[:, first : first + 10])
        call_law(robot.adapt, ctrl)
    robot.ticks += 1


@kernel
def tick_parts(ctrl, inputs, torque, parts):
    """Make a tick, for `inputs`, (5, n): see `load_errors`; write its torque, (n,).

    `parts` is the sum of those that are wanted: 8 adaptation by the tick before, 1 the signals, 2
    the model by the compiled dynamics, 4 the torques.
    """
    if parts & 8:
        adapt(ctrl)
    if parts & 1:
        signals(ctrl, inputs)
    if parts & 2:
        evaluate_model(ctrl, inputs)
    if parts & 4:
        torques(ctrl, torque)
