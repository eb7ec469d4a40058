"""The functions of `functions`, compiled."""

from __future__ import annotations

from fpid_pin.kernels import functions
from fpid_pin.kernels.compiled import kernel

clip = kernel(functions.clip, inline=True)
winds_up = kernel(functions.winds_up, inline=True)
sign = kernel(functions.sign, inline=True)
