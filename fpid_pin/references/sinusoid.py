"""Sinusoids: the reference of the paper's experiment, eq. (38)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.references.reference import Motion


@described("sinusoid", "Reference")
@dataclass(frozen=True, eq=False)
class Sinusoid:
    """``q_d = offset + amplitude sin(frequency t + phase)``, each a scalar or (n,).

    Parameters
    ----------
    amplitude
        [rad].
    frequency
        [rad/s].
    phase
        [rad].
    offset
        [rad].
    """

    amplitude: ArrayLike = 1.0
    frequency: ArrayLike = 1.0
    phase: ArrayLike = 0.0
    offset: ArrayLike = 0.0

    def __post_init__(self) -> None:
        for name in ("amplitude", "frequency", "phase", "offset"):
            array = checks.floats(f"reference.{name}", getattr(self, name), max_ndim=1)
            object.__setattr__(self, name, array)

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        amplitude, frequency = np.asarray(self.amplitude), np.asarray(self.frequency)
        angle = np.multiply.outer(t, np.atleast_1d(frequency)) + self.phase
        q = self.offset + amplitude * np.sin(angle)
        v = amplitude * frequency * np.cos(angle)
        a = -amplitude * frequency**2 * np.sin(angle)
        return q, v, a
