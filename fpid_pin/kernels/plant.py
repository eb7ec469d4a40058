"""The true arm under the drives' torques, over one step."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.friction import apply_dry_friction
from fpid_pin.kernels.limits import clip
from fpid_pin.kernels.rigid_body import forward_dynamics, set_base_acceleration


@kernel(inline=True)
def apply_actuators(plant, torque, forces, rows, k):
    """Clip the torques at the drives' limits, and record q, q' and torque as row k.

    tau is then what turns the arm: the torque, what pushes from outside, and F_v q' against it.
    Returns whether a torque is not finite.
    """
    diverged = False
    for j in range(torque.size):
        c = plant.joints[j]
        # Asked before the limits, which would hide it.
        diverged = diverged or not math.isfinite(torque[j])
        u = clip(torque[j], c.limit)
        rows[0, k, j] = plant.q[j]
        rows[1, k, j] = plant.v[j]
        rows[2, k, j] = u
        plant.tau[j] = u + c.push - c.viscous * plant.v[j] + forces[0, k, j]
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


@kernel(inline=True)
def accelerate(plant, q, v, tau, a):
    """Write the true arm's accelerations, (n,); the factors of its M stay in `plant.mass`."""
    set_base_acceleration(plant.frames, q.size, plant.gravity)
    forward_dynamics(plant.bodies, plant.frames, q, v, tau, plant.mass, a)


@kernel(inline=True)
def finish_euler(plant, rubs, h):
    """Take a step of semi-implicit Euler from the accelerations `plant.a`; friction is implicit.

    `plant.mass` holds the factors of M + h F_v where there is dry friction.
    """
    integrate_velocity(plant.v, plant.a, h)
    if rubs:
        apply_dry_friction(
            plant.bodies, plant.mass, plant.dry, plant.stuck, plant.friction, plant.v, plant.work,
            plant.response, plant.matrix, h,
        )  # fmt: skip
    integrate_position(plant.q, plant.v, h)


@kernel(inline=True)
def runge_kutta_stage(plant, forces, k, i, h):
    """Write where stage i, 1 to 3, of the classical Runge-Kutta rule looks, and its torques.

    Rows of `plant.stages`: angles, rates and torques of a stage; then for each of the four stages
    its slope, rates and accelerations. The torques differ from those of the step's start in the
    disturbance and in F_v q'.
    """
    part = h if i == 3 else 0.5 * h
    at = 2 if i == 3 else 1
    for j in range(plant.q.size):
        c = plant.joints[j]
        q = plant.q[j] + part * plant.stages[1 + 2 * i, j]
        v = plant.v[j] + part * plant.stages[2 + 2 * i, j]
        brake = c.viscous * (v - plant.v[j])
        plant.stages[0, j] = q
        plant.stages[1, j] = v
        plant.stages[2, j] = plant.tau[j] + (forces[at, k, j] - forces[0, k, j]) - brake


@kernel(inline=True)
def finish_runge_kutta(plant, h):
    """Take the step from the slopes of all four stages."""
    for j in range(plant.q.size):
        middle = 2.0 * plant.stages[5, j] + 2.0 * plant.stages[7, j]
        plant.q[j] += h / 6.0 * (plant.stages[3, j] + middle + plant.stages[9, j])
        middle = 2.0 * plant.stages[6, j] + 2.0 * plant.stages[8, j]
        plant.v[j] += h / 6.0 * (plant.stages[4, j] + middle + plant.stages[10, j])


@kernel(inline=True)
def move(plant, rubs, forces, k, h):
    """Take a step with the torque held, by the compiled dynamics."""
    stages = plant.stages
    accelerate(plant, plant.q, plant.v, plant.tau, plant.a)
    if stages.shape[0] == 0:
        finish_euler(plant, rubs, h)
    else:
        for j in range(plant.q.size):
            stages[3, j] = plant.v[j]
            stages[4, j] = plant.a[j]
        for i in range(1, 4):
            runge_kutta_stage(plant, forces, k, i, h)
            for j in range(plant.q.size):
                stages[3 + 2 * i, j] = stages[1, j]
            accelerate(plant, stages[0], stages[1], stages[2], stages[4 + 2 * i])
        finish_runge_kutta(plant, h)


@kernel(inline=True)
def has_diverged(plant):
    """Return whether a joint has run away or lost its numbers."""
    diverged = False
    for j in range(plant.q.size):
        slow = abs(plant.v[j]) <= plant.joints[j].runaway
        diverged = diverged or not slow or not math.isfinite(plant.q[j])
    return diverged
