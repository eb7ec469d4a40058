"""What the controller is told: delay, noise, bias, encoder steps, differentiation, so ordered."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel


@kernel(inline=True)
def rounded(x):
    """Return the nearest whole number, the even one of two as near."""
    low = math.floor(x)
    part = x - low
    if part > 0.5 or (part == 0.5 and low != 2.0 * math.floor(0.5 * low)):
        low += 1.0
    return low


@kernel(inline=True)
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
    """Write the measured q and q' into `inputs`, (5, n).

    Parameters
    ----------
    joints
        SENSOR, (n,); none: what is measured is exact.
    history
        A ring of true values, (depth, 2, n).
    noise
        White noise, (K, 2, n); the tick's row is taken modulo K.
    q, v
        The true state, (n,).
    tick
        Number of the sample.
    """
    if joints.size == 0:
        for j in range(q.size):
            inputs[0, j] = q[j]
            inputs[1, j] = v[j]
    else:
        spoil(joints, history, noise, q, v, tick, inputs)
