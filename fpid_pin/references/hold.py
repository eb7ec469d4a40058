"""Staying where one is: regulation."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.references.reference import Motion


@described("hold", "Reference")
@dataclass(frozen=True, eq=False)
class Hold:
    """Stay at a position (regulation).

    Parameters
    ----------
    position
        Scalar or (n,) [rad].
    """

    position: ArrayLike = 0.0

    def __post_init__(self) -> None:
        array = checks.floats("reference.position", self.position, max_ndim=1)
        object.__setattr__(self, "position", array)

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        q = np.zeros((len(t), 1)) + np.atleast_1d(np.asarray(self.position))
        return q, np.zeros_like(q), np.zeros_like(q)
