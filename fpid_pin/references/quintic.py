"""A smooth move from one pose to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.references.reference import Motion


@described("quintic", "Reference")
@dataclass(frozen=True, eq=False)
class Quintic(Description):
    """From one pose to another, at rest at both ends: the minimum-jerk move.

    ``q = start + (end - start) (10 x^3 - 15 x^4 + 6 x^5)``, x = (t - begin)/duration, which is at
    rest, with no acceleration, at x = 0 and 1 (Flash and Hogan, Journal of Neuroscience 5, 1985).
    Before and after it holds.

    Parameters
    ----------
    start, end
        Scalar or (n,) [rad].
    duration
        Of the move [s].
    begin
        When it starts [s].
    """

    start: Annotated[ArrayLike, PerJoint("rad")]
    end: Annotated[ArrayLike, PerJoint("rad")]
    duration: Annotated[float, Number("s", above=0.0)]
    begin: Annotated[float, Number("s")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        x = np.clip((t - self.begin) / self.duration, 0.0, 1.0)
        part = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        start = np.atleast_1d(np.asarray(self.start))
        way = np.atleast_1d(np.asarray(self.end)) - start
        return start + np.multiply.outer(part, way), np.outer(rate, way), np.outer(bend, way)
