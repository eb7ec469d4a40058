"""What the nominal model adds to the torque of one robot: for what leaves Python.

The terms that `control.model_terms` asks Pinocchio for, from `rigid_body`; M and C q' + G are
worked out once a tick where they are those of the measured state. Arrays have a first axis of one
run, as the kernels of supervisor and observer want it.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.law import fpids
from fpid_pin.kernels.layout import layout
from fpid_pin.kernels.limits import saturate
from fpid_pin.kernels.observer import compensate, correct, predict
from fpid_pin.kernels.rigid_body import factor_tree, ground, solve_tree, terms
from fpid_pin.kernels.supervisor import project, push, shorten, supervise, weigh

#: What is asked of the model: feedforward; that an observer runs, and that what it finds is
#: cancelled; which supervisor there is.
ASKED = layout("", "feedforward observes compensates sampled paper")
#: Rows of the room that `assist` works in.
ROWS = 14
#: A joint under computed torque, eq. (8).
COMPUTED = layout("k0 k1 limit cut ticks")


@kernel
def survey(bodies, frames, gravity, q, v, bias, mass):
    """Write C q' + G, (n,), and the lower half of M, (n, n), of a state."""
    ground(frames, bodies.size, gravity)
    terms(bodies, frames, q, v, bias, mass)


@kernel
def mass_times(bodies, mass, x, out):
    """Write M x, (n,); joints that do not carry one another have no entry."""
    n = bodies.size
    for i in range(n):
        out[i] = mass[i, i] * x[i]
    for i in range(n):
        k = bodies[i].parent
        while k < n:
            out[i] += mass[i, k] * x[k]
            out[k] += mass[i, k] * x[i]
            k = bodies[k].parent


@kernel
def factored_mass(bodies, mass, factored):
    """Write L and 1/D of M = L^T D L, and leave M as it is."""
    for i in range(bodies.size):
        for k in range(i + 1):
            factored[i, k] = mass[i, k]
    factor_tree(bodies, factored)


@kernel
def inverse_dynamics(bodies, frames, gravity, q, v, a, bias, mass, out):
    """Write M a + C v + G, (n,)."""
    survey(bodies, frames, gravity, q, v, bias, mass)
    mass_times(bodies, mass, a, out)
    for j in range(bodies.size):
        out[j] += bias[j]


@kernel
def respond(bodies, factored, joints, torque, v_hat, bias, a):
    """Write what the model makes of a torque, (n,): M^-1 (u - F_v v^ - C v^ - G)."""
    for j in range(bodies.size):
        a[j] = torque[j] - joints[j].viscous * v_hat[j] - bias[j]
    solve_tree(bodies, factored, a)


@kernel
def paper_torque(
    alive, robots, joints, bodies, gravity, frames, mass, factored, room, inputs, torque
):  # fmt: skip
    """Add u_s of (20)."""
    still, g, c, demand, b = room[0], room[1], room[2], room[3], room[4]
    m_demand, feedforward = room[5], room[6]
    n = bodies.size
    for j in range(n):
        still[0, j] = 0.0
    survey(bodies, frames, gravity, inputs[0, 0], still[0], g[0], mass)
    survey(bodies, frames, gravity, inputs[0, 0], inputs[1, 0], c[0], mass)
    for j in range(n):
        c[0, j] -= g[0, j]
    weigh(alive, robots, joints, demand, b)
    mass_times(bodies, mass, demand[0], m_demand[0])
    mass_times(bodies, mass, inputs[4, 0], feedforward[0])
    factored_mass(bodies, mass, factored)
    solve_tree(bodies, factored, b[0])
    supervise(alive, robots, joints, g, c, m_demand, feedforward, b, torque)


@kernel
def sampled_torque(asked, alive, robots, joints, bodies, mass, factored, room, inputs, torque):
    """Add u_s of the sampled supervisor; `room` as `assist` fills it."""
    a, change, reserve, u_s, before = room[3], room[4], room[7], room[8], room[9]
    n = bodies.size
    acts = project(alive, robots, joints, inputs, a, change)
    if acts:
        for j in range(n):
            reserve[0, j] = change[0, j]
        solve_tree(bodies, factored, reserve[0])
        acts = shorten(alive, robots, joints, reserve, change)
    if acts:
        for j in range(n):
            before[0, j] = torque[0, j]
        mass_times(bodies, mass, change[0], u_s[0])
        push(alive, robots, joints, u_s, torque)
        cut = False
        for j in range(n):
            cut = cut or joints[0, j].cut != 0.0
        if asked.observes and cut:
            # Saturation left less of it.
            for j in range(n):
                change[0, j] = torque[0, j] - before[0, j]
            solve_tree(bodies, factored, change[0])


@kernel
def assist(
    alive, asked, robots, joints, bodies, gravity, frames, mass, factored, room, inputs, acts,
    torque,
):  # fmt: skip
    """Add the model's torques to that of the law, (1, n): feedforward, observer, supervisor.

    `room` is (`ROWS`, 1, n); `acts` says whether the paper's supervisor does.
    """
    v_hat, xi, bias, a, change = room[0], room[1], room[2], room[3], room[4]
    lost, forward = room[5], room[6]
    n = bodies.size
    if asked.feedforward or asked.observes or asked.sampled:
        correct(alive, robots, joints, inputs[1], v_hat, xi)
        if asked.feedforward:
            inverse_dynamics(
                bodies, frames, gravity, inputs[2, 0], inputs[3, 0], inputs[4, 0], bias[0], mass,
                forward[0],
            )  # fmt: skip
            for j in range(n):
                forward[0, j] += joints[0, j].viscous * inputs[3, 0, j]
        survey(bodies, frames, gravity, inputs[0, 0], v_hat[0], bias[0], mass)
        factored_mass(bodies, mass, factored)
        if asked.compensates:
            mass_times(bodies, mass, xi[0], lost[0])
        if asked.feedforward or asked.compensates:
            compensate(alive, joints, forward, lost, torque)
        if asked.sampled:
            respond(bodies, factored, joints[0], torque[0], v_hat[0], bias[0], a[0])
            sampled_torque(
                asked, alive, robots, joints, bodies, mass, factored, room, inputs, torque
            )  # fmt: skip
    if acts and asked.paper:
        paper_torque(
            alive, robots, joints, bodies, gravity, frames, mass, factored, room[7:ROWS], inputs,
            torque,
        )  # fmt: skip
    if asked.observes:
        if not asked.sampled:
            respond(bodies, factored, joints[0], torque[0], v_hat[0], bias[0], a[0])
        predict(robots, joints, a, change)


@kernel
def assisted(
    alive, asked, robots, joints, ops, poles, modes, table, bodies, gravity, frames, mass,
    factored, room, inputs, torque,
):  # fmt: skip
    """Make one tick of an FPID that the model assists; arrays as in `law.fpids`, of one run."""
    acts = fpids(alive, robots, joints, ops, poles, modes, table, inputs, torque)
    assist(
        alive, asked, robots, joints, bodies, gravity, frames, mass, factored, room, inputs, acts,
        torque,
    )  # fmt: skip


@kernel
def computed_torque(joints, bodies, gravity, frames, mass, room, inputs, torque):
    """Make one tick of u*, eq. (8); `room` is (2, n)."""
    bias, a = room[0], room[1]
    q, v = inputs[0, 0], inputs[1, 0]
    for j in range(bodies.size):
        c = joints[j]
        a[j] = inputs[4, 0, j] + c.k1 * (inputs[3, 0, j] - v[j]) + c.k0 * (inputs[2, 0, j] - q[j])
    inverse_dynamics(bodies, frames, gravity, q, v, a, bias, mass, torque)
    saturate(joints, torque)
