"""Small functions that kernels and laws share.

Importing this module does not load numba, so a file with a law loads at once.
"""

import math


def clip(x: float, limit: float) -> float:
    """Return x within [-limit, limit]; NaN and inf stay as they are.

    A law whose numbers have overflowed would otherwise look like one at its limit.
    """
    if math.isfinite(x):
        if x > limit:
            x = limit
        elif x < -limit:
            x = -limit
    return x


def winds_up(cut: float, push: float) -> bool:
    """Return whether `push` would drive a torque that was cut further beyond its limit.

    Anti-windup is conditional: what would ask for yet more in the same direction is held, what
    unwinds goes on (Åström and Hägglund, *Advanced PID Control*, 2006, section 3.5).
    """
    return cut * push > 0.0


def sign(x: float) -> float:
    """Return -1, 0 or 1."""
    s = 0.0
    if x > 0.0:
        s = 1.0
    elif x < 0.0:
        s = -1.0
    return s
