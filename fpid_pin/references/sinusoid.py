"""Sinusoids: the reference of the paper's experiment, eq. (38)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.references.reference import Motion


@described("sinusoid", "Reference")
@dataclass(frozen=True, eq=False)
class Sinusoid(Description):
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

    amplitude: Annotated[ArrayLike, PerJoint("rad")] = 1.0
    frequency: Annotated[ArrayLike, PerJoint("rad/s")] = 1.0
    phase: Annotated[ArrayLike, PerJoint("rad")] = 0.0
    offset: Annotated[ArrayLike, PerJoint("rad")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        amplitude, frequency = np.asarray(self.amplitude), np.asarray(self.frequency)
        angle = np.multiply.outer(t, np.atleast_1d(frequency)) + self.phase
        q = self.offset + amplitude * np.sin(angle)
        v = amplitude * frequency * np.cos(angle)
        a = -amplitude * frequency**2 * np.sin(angle)
        return q, v, a
