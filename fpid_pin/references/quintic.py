"""A smooth move from one pose to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references.reference import Motion


@described("quintic", "Reference")
@dataclass(frozen=True, eq=False)
class Quintic:
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

    start: ArrayLike
    end: ArrayLike
    duration: float
    begin: float = 0.0

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            array = checks.floats(f"reference.{name}", getattr(self, name), max_ndim=1)
            object.__setattr__(self, name, array)
        lengths = {len(a) for a in (self.start, self.end) if np.ndim(a)}  # type: ignore[arg-type]
        if len(lengths) > 1:
            shapes = f"shapes {np.shape(self.start)} and {np.shape(self.end)}"
            raise ArgumentError("reference.start, end", "one length", shapes)
        duration = checks.number("reference.duration", self.duration, above=0.0)
        object.__setattr__(self, "duration", duration)
        object.__setattr__(self, "begin", checks.number("reference.begin", self.begin))

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        x = np.clip((t - self.begin) / self.duration, 0.0, 1.0)
        part = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        start = np.atleast_1d(np.asarray(self.start))
        way = np.atleast_1d(np.asarray(self.end)) - start
        return start + np.multiply.outer(part, way), np.outer(rate, way), np.outer(bend, way)
