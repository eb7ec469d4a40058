"""Whole stretches of a simulation in one call: law, drives, dynamics, one robot at a time.

Nothing here is new: a tick is made of the kernels that are called one by one otherwise, in the same
order, on the same numbers, so its bits are the same. Robots do not see each other, and each is
flown for all ticks of a block before the next: its records stay in the cache.
"""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.friction import rub
from fpid_pin.kernels.law import fpid
from fpid_pin.kernels.motion import accelerate, coast, drive_one, look
from fpid_pin.kernels.rigid_body import forward_dynamics, ground
from fpid_pin.kernels.sensors import measure_one


@kernel(inline=True)
def step(
    r, model, bodies, gravity, frames, mass, rubs, dry, stuck, force, room, response, matrix, h,
    x, tau, a,
):  # fmt: skip
    """Take a step of semi-implicit Euler of run r under the torques `tau`; friction is implicit."""
    k = model[r]
    ground(frames, x.shape[2], gravity[k])
    forward_dynamics(bodies[k], frames, x[0, r], x[1, r], tau[r], mass, a[r])
    accelerate(x[1, r], a[r], h)
    if rubs:
        rub(bodies[k], mass, dry[r], stuck[r], force[r], x[1, r], room, response, matrix, h)
    coast(x[0, r], x[1, r], h)


@kernel
def steps(
    alive, model, bodies, gravity, frames, mass, rubs, dry, stuck, force, room, response, matrix, h,
    x, tau, a,
):  # fmt: skip
    """Take a step of every run."""
    for r in range(alive.size):
        if alive[r]:
            step(
                r, model, bodies, gravity, frames, mass, rubs, dry, stuck, force, room, response,
                matrix, h, x, tau, a,
            )  # fmt: skip


@kernel
def fly(
    alive, robots, joints, ops, poles, modes, table,
    model, bodies, gravity, frames, mass, rubs, dry, stuck, force, room, response, matrix, h,
    plants, x, seen, torque, tau, a, references, forces, rows,
    senses, sensors, history, noise, tick, keeps, kept, values, first, count, ends,
):  # fmt: skip
    """Make `count` ticks, from row `first` of a block on, of every run that is alive.

    `ends` says in which row a run's state or torque ceased to count; it stays as it then was.
    """
    for r in range(alive.size):
        ends[r] = -1
        k = first
        going = alive[r]
        while going and k < first + count:
            if senses:
                row = (tick + k - first) % max(noise.shape[0], 1)
                measure_one(r, sensors, x, tick + k - first, history, noise, row, seen)
            fpid(
                robots[r], joints[r], ops[r], poles, modes[r], table,
                seen[0, r], seen[1, r], seen[2, r], seen[3, r], torque[r],
            )  # fmt: skip
            if drive_one(r, plants, torque, x, forces, k, rows, tau):
                ends[r] = k
            if keeps:
                values[k, r] = robots[r].value
                for j in range(x.shape[2]):
                    c = joints[r, j]
                    kept[0, k, r, j] = c.kp
                    kept[1, k, r, j] = c.ki
                    kept[2, k, r, j] = c.kd
                    kept[3, k, r, j] = c.u_fpid
                    kept[4, k, r, j] = c.u_s
                    kept[5, k, r, j] = c.s
                    kept[6, k, r, j] = c.lam
                    kept[7, k, r, j] = c.mu
            if ends[r] < 0:
                step(
                    r, model, bodies, gravity, frames, mass, rubs, dry, stuck, force, room,
                    response, matrix, h, x, tau, a,
                )  # fmt: skip
                if look(r, plants, x, references, (k + 1) % rows.shape[1], seen):
                    ends[r] = k + 1
            going = ends[r] < 0
            k += 1
