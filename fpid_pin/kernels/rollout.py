"""Whole stretches of a simulation of one robot: controller, drives and dynamics in one call."""

from __future__ import annotations

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.metrics import measure_joints
from fpid_pin.kernels.plant import apply_actuators, has_diverged, move
from fpid_pin.kernels.records import Controller
from fpid_pin.kernels.sensors import measure
from fpid_pin.kernels.tick import tick_parts


@kernel
def load_reference(reference, k, inputs):
    """Write row k of the reference's q, v, a into `inputs`, (5, n)."""
    for i in range(3):
        for j in range(inputs.shape[1]):
            inputs[2 + i, j] = reference[i, k, j]


@kernel
def keep_signals(numbers, columns, kept, k):
    """Keep some of the controller's numbers as row k, (signals, K, n)."""
    for i in range(columns.size):
        for j in range(numbers.shape[0]):
            kept[i, k, j] = numbers[j, columns[i]]


@kernel
def rollout(c, plant, sensing, rows, inputs, torque, counts):
    """Make ticks of one robot, with room for one, (5, n) and (n,).

    `counts` are the number of the first row in the run; how many to make; at which of `rows` to
    begin; how many rows of the run count for figures of merit; whether there is dry friction.
    Returns the row, in the run, from which on nothing counts as a number was lost; -1: none.
    """
    h = c.robot[0].h
    ended = -1
    k = 0
    while k < counts[1] and ended < 0:
        number = counts[0] + k
        row = counts[2] + k
        measure(sensing.joints, sensing.history, sensing.noise, plant.q, plant.v, number, inputs)
        load_reference(rows.reference, row, inputs)
        tick_parts(c, inputs, torque, 7 if number == 0 else 15)
        if apply_actuators(
            plant.joints, plant.q, plant.v, torque, rows.forces, rows.motion, row, plant.tau
        ):
            ended = number
        else:
            keep_signals(c.numbers, rows.columns, rows.kept, row)
            if number < counts[3]:
                half = counts[3] // 2
                measure_joints(rows.sums, rows.reference, rows.motion, row, number, half, h)
            move(plant, counts[4] != 0, rows.forces, row, h)
            if has_diverged(plant.joints, plant.q, plant.v):
                ended = number + 1
        k += 1
    return ended


@kernel
def step_tick(
    robot, joints, numbers, own, ops, poles, modes, table, bodies, links, motions, frames, gravity,
    mass, factored, terms, inputs, torque, parts,
):  # fmt: skip
    """Make parts of a tick for a caller in Python: its arrays one by one, which costs least."""
    c = Controller(
        robot, joints, numbers, own, ops, poles, modes, table, bodies, links, motions, frames,
        gravity, mass, factored, terms,
    )  # fmt: skip
    tick_parts(c, inputs, torque, parts)
