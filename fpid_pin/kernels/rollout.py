"""Whole stretches of a simulation of one robot: sensors, controller, drives, dynamics, figures.

What the controller is told has delay, noise, bias, encoder steps and differentiation, so ordered.
What figures of merit are made of, sums and peaks, is gathered a row at a time.
"""

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.plant import apply_actuators, has_diverged, move
from fpid_pin.kernels.tick import tick_parts


def rounded(x):
    """Return the nearest whole number, the even one of two as near."""
    low = math.floor(x)
    part = x - low
    if part > 0.5 or (part == 0.5 and low != 2.0 * math.floor(0.5 * low)):
        low += 1.0
    return low


def spoil(joints, history, noise, q, v, tick, inputs):
    """Write what sensors with faults measure: see `measure`."""
    depth = history.shape[0]
    slot = tick % depth
    for j in range(q.size):
        c = joints[j]
        history[slot, 0, j] = q[j]
        history[slot, 1, j] = v[j]
        # Before t = 0 the arm is taken to have been where it starts.
        then = (tick - min(c.delay, tick)) % depth
        angle = history[then, 0, j]
        speed = history[then, 1, j]
        if noise.shape[0] > 0:
            row = tick % noise.shape[0]
            angle += c.noise_q * noise[row, 0, j]
            speed += c.noise_v * noise[row, 1, j]
        speed += c.bias
        if c.resolution > 0.0:
            angle = rounded(angle / c.resolution) * c.resolution
        if c.derived:
            if tick == 0:
                c.last = angle
            c.filtered = c.keep * c.filtered + c.gain * (angle - c.last)
            c.last = angle
            speed = c.filtered
        inputs[0, j] = angle
        inputs[1, j] = speed


@kernel
def measure(joints, history, noise, q, v, tick, inputs):
    """Write q and q', (n,), as sample number `tick` measures them into `inputs`, (5, n).

    The others are those of `records.Sensing`.
    """
    if joints.size == 0:
        for j in range(q.size):
            inputs[0, j] = q[j]
            inputs[1, j] = v[j]
    else:
        spoil(joints, history, noise, q, v, tick, inputs)


def measure_row(c, e, u, k, half, h):
    """Add row k of one joint, with error e and torque u; `half` is the row that the half begins."""
    c.square += e * e
    if k >= half:
        c.late += e * e
        c.late_rows += 1
    c.absolute += abs(e)
    c.aged += k * h * abs(e)
    c.effort += u * u
    if c.rows > 0:
        c.changes += abs(u - c.last)
        c.jumps += (u - c.last) * (u - c.last)
    else:
        c.start = e
    c.peak = max(c.peak, abs(u))
    c.worst = max(c.worst, abs(e))
    c.beyond = max(c.beyond, -e if c.start > 0.0 else e)
    if abs(e) > c.band:
        c.settled = k + 1
    if abs(u) >= c.limit:
        c.at_limit += 1
    c.last = u
    c.rows += 1


@kernel
def measure_joints(sums, reference, motion, k, number, half, h):
    """Add row k of blocks of reference and motion, the row of that `number` of its run."""
    for j in range(sums.size):
        error = reference[0, k, j] - motion[0, k, j]
        measure_row(sums[j], error, motion[2, k, j], number, half, h)


@kernel
def measure_rows(sums, reference, motion, half, h):
    """Add all rows of a recorded run, in one block."""
    for k in range(motion.shape[1]):
        measure_joints(sums, reference, motion, k, k, half, h)


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
