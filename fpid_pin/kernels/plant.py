"""The true arm under the drives' torques, over one step."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.friction import apply_dry_friction
from fpid_pin.kernels.limits import clip
from fpid_pin.kernels.records import WORKSPACE
from fpid_pin.kernels.rigid_body import forward_dynamics


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


@kernel(inline=True)
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
