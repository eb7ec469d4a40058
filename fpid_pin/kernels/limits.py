"""Limits: what a drive can give, and when a number is none any more."""

from __future__ import annotations

import math

from fpid_pin.kernels.compiled import kernel


@kernel(inline=True)
def clip(x, limit):
    """Return x within [-limit, limit]; NaN and inf stay, so that nobody takes them for a torque.

    A law whose numbers have overflowed would otherwise look like one at its limit.
    """
    if math.isfinite(x):
        if x > limit:
            x = limit
        elif x < -limit:
            x = -limit
    return x


@kernel(inline=True)
def winds_up(cut, push):
    """Return whether `push` would drive a torque that was cut further beyond its limit.

    Anti-windup is conditional: what would ask for yet more in the same direction is held, what
    unwinds goes on (Åström and Hägglund, *Advanced PID Control*, 2006, section 3.5).
    """
    return cut * push > 0.0


@kernel
def finite(values):
    """Return whether every number of a flat array is finite."""
    sound = True
    for i in range(values.size):
        sound = sound and math.isfinite(values[i])
    return sound


@kernel
def saturate(joints, torque):
    """Clip the torque of one robot, (n,), and note by how much; count the tick."""
    for j in range(joints.size):
        c = joints[j]
        asked = torque[j]
        torque[j] = clip(asked, c.limit)
        c.cut = asked - torque[j]
        c.ticks += 1.0
