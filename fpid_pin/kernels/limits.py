"""The functions of `functions`, compiled, and a check of many numbers at once."""

from __future__ import annotations

import math

from fpid_pin.kernels import functions
from fpid_pin.kernels.compiled import kernel

clip = kernel(functions.clip, inline=True)
winds_up = kernel(functions.winds_up, inline=True)
sign = kernel(functions.sign, inline=True)


@kernel
def finite(values):
    """Return whether every number of a flat array is finite."""
    sound = True
    for i in range(values.size):
        sound = sound and math.isfinite(values[i])
    return sound
