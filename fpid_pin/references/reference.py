"""What a reference is, a trajectory for the joints, and those of a formula."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, PerJoint
from fpid_pin.descriptions import Description, described

#: Angles, rates and accelerations.
Motion = tuple[FloatArray, FloatArray, FloatArray]


@runtime_checkable
class Reference(Protocol):
    """A trajectory of one robot; anything with this method will do."""

    def sample(self, t: FloatArray) -> Motion:
        """Return angles [rad], rates [rad/s] and accelerations [rad/s^2] at times `t`.

        Parameters
        ----------
        t
            Times [s], (K,).

        Returns
        -------
        tuple of ndarray
            Three arrays (K, n), or (K, 1) where all joints do the same.
        """
        ...


@described("hold", "Reference")
@dataclass(frozen=True, eq=False)
class Hold(Description):
    """Stay at a position: regulation.

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
        acceleration = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        start = np.atleast_1d(np.asarray(self.start))
        way = np.atleast_1d(np.asarray(self.end)) - start
        q = start + np.multiply.outer(part, way)
        return q, np.outer(rate, way), np.outer(acceleration, way)
