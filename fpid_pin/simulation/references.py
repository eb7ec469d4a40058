"""Reference trajectories: what the joints should do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described

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
