"""Staying where one is: regulation."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.references.reference import Motion


@described("hold", "Reference")
@dataclass(frozen=True, eq=False)
class Hold(Description):
    """Stay at a position (regulation).

    Parameters
    ----------
    position
        Scalar or (n,) [rad].
    """

    position: Annotated[ArrayLike, PerJoint("rad")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        q = np.zeros((len(t), 1)) + np.atleast_1d(np.asarray(self.position))
        return q, np.zeros_like(q), np.zeros_like(q)
