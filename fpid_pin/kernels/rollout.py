"""Whole stretches of a simulation of one robot: controller, drives and dynamics in one call."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.metrics import measure_row
from fpid_pin.kernels.plant import apply_actuators, has_diverged, move
from fpid_pin.kernels.records import Controller
from fpid_pin.kernels.sensors import measure
from fpid_pin.kernels.tick import adapt, ask_model, signals, tick, torques


@kernel(inline=True)
def load_sample(plant, sensing, rows, k, number, inputs):
    """Write what the controller is given at row k: measured q, v, and the reference's q, v, a."""
    if sensing.joints.size > 0:
        measure(sensing, plant.q, plant.v, number, inputs)
    else:
        for j in range(plant.q.size):
            inputs[0, j] = plant.q[j]
            inputs[1, j] = plant.v[j]
    for i in range(3):
        for j in range(plant.q.size):
            inputs[2 + i, j] = rows.reference[i, k, j]


@kernel(inline=True)
def keep_row(c, plant, rows, k, number, applied):
    """Keep the law's signals of row k, and add it to the figures of merit if it is `applied`."""
    for i in range(rows.columns.size):
        for j in range(plant.q.size):
            rows.kept[i, k, j] = c.numbers[j, rows.columns[i]]
    if number < applied:
        for j in range(rows.sums.size):
            error = rows.reference[0, k, j] - rows.motion[0, k, j]
            torque = rows.motion[2, k, j]
            measure_row(rows.sums[j], error, torque, number, applied // 2, c.robot[0].h)


@kernel
def rollout(c, plant, sensing, rows, inputs, torque, counts):
    """Make ticks of one robot.

    Parameters
    ----------
    c, plant, sensing, rows
        See `records`.
    inputs, torque
        Room for a tick, (5, n) and (n,).
    counts
        Number of the first row, in the run; how many to make; at which of `rows` to begin; how many
        rows of the run count for figures of merit; whether there is dry friction.

    Returns
    -------
    int
        The row, in the run, from which on nothing counts as a number was lost; -1: none.
    """
    h = c.robot[0].h
    ended = -1
    k = 0
    while k < counts[1] and ended < 0:
        number = counts[0] + k
        row = counts[2] + k
        load_sample(plant, sensing, rows, row, number, inputs)
        tick(c, inputs, torque)
        if apply_actuators(plant, torque, rows.forces, rows.motion, row):
            ended = number
        else:
            keep_row(c, plant, rows, row, number, counts[3])
            adapt(c)
            move(plant, counts[4] != 0, rows.forces, row, h)
            if has_diverged(plant):
                ended = number + 1
        k += 1
    return ended


@kernel
def step_tick(
    robot, joints, numbers, own, ops, poles, modes, table, bodies, links, motions, frames, gravity,
    mass, factored, terms, inputs, torque, parts,
):  # fmt: skip
    """Make parts of a tick for a caller in Python: its arrays one by one, which costs least.

    `parts`: 8 adaptation by the tick before, 1 the signals, 2 the model by the compiled dynamics, 4
    the torques.
    """
    c = Controller(
        robot, joints, numbers, own, ops, poles, modes, table, bodies, links, motions, frames,
        gravity, mass, factored, terms,
    )  # fmt: skip
    if parts & 8:
        adapt(c)
    if parts & 1:
        signals(c, inputs)
    if parts & 2:
        ask_model(c, inputs)
    if parts & 4:
        torques(c, torque)
