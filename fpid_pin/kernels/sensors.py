"""What the controller is told: delay, noise, bias, encoder steps, differentiation, so ordered."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel
from fpid_pin.kernels.layout import layout

#: A joint's sensors: standard deviations of position and velocity noise, the velocity's bias, the
#: encoder's step; what a filter of differences keeps and gains a sample; its state. Flags: how many
#: samples everything is late, and whether the velocity is the filter's.
SENSOR = layout("noise_q noise_v bias resolution keep gain filtered last", "delay derived")


@kernel(inline=True)
def rounded(x):
    """Return the nearest whole number, the even one of two as near."""
    low = math.floor(x)
    part = x - low
    if part > 0.5 or (part == 0.5 and low != 2.0 * math.floor(0.5 * low)):
        low += 1.0
    return low


@kernel(inline=True)
def measure_one(r, joints, x, tick, history, noise, row, seen):
    """Write the measured q and q' of run r into `seen`, (5, runs, n); x = [q, q'] is true.

    `history`, (depth, 2, runs, n), is a ring of true values; `noise` holds rows of white noise.
    """
    depth = history.shape[0]
    slot = tick % depth
    for j in range(x.shape[2]):
        c = joints[r, j]
        history[slot, 0, r, j] = x[0, r, j]
        history[slot, 1, r, j] = x[1, r, j]
        # Before t = 0 the arm is taken to have been where it starts.
        then = (tick - min(c.delay, tick)) % depth
        angle = history[then, 0, r, j]
        speed = history[then, 1, r, j]
        if noise.shape[0] > 0:
            angle += c.noise_q * noise[row, 0, r, j]
            speed += c.noise_v * noise[row, 1, r, j]
        speed += c.bias
        if c.resolution > 0.0:
            angle = rounded(angle / c.resolution) * c.resolution
        if c.derived:
            if tick == 0:
                c.last = angle
            c.filtered = c.keep * c.filtered + c.gain * (angle - c.last)
            c.last = angle
            speed = c.filtered
        seen[0, r, j] = angle
        seen[1, r, j] = speed


@kernel
def measure(alive, joints, x, tick, history, noise, row, seen):
    """Write what is measured of every run; zeros of those that have ended."""
    for r in range(alive.size):
        if alive[r]:
            measure_one(r, joints, x, tick, history, noise, row, seen)
        else:
            for j in range(x.shape[2]):
                seen[0, r, j] = 0.0
                seen[1, r, j] = 0.0
