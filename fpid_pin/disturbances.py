"""Disturbance torques: d(t) in M q'' = U - C q' - G + d(t), after eq. (35)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError

__all__ = ["Cosine", "Disturbance", "Pulse", "Sum"]


@runtime_checkable
class Disturbance(Protocol):
    """A torque on the joints of one robot; anything with this method will do."""

    def sample(self, t: FloatArray) -> FloatArray:
        """Return d [N m] at times `t` [s], (K,), as (K, n) or (K, 1)."""
        ...


@described("cosine", "Disturbance")
@dataclass(frozen=True, eq=False)
class Cosine(Description):
    """``d = amplitude cos(frequency t + phase)``, each a scalar or (n,): eq. (37).

    Parameters
    ----------
    amplitude
        [N m].
    frequency
        [rad/s].
    phase
        [rad].
    """

    amplitude: Annotated[ArrayLike, PerJoint("N m")]
    frequency: Annotated[ArrayLike, PerJoint("rad/s")] = 5.0 * np.pi
    phase: Annotated[ArrayLike, PerJoint("rad")] = 0.0

    def sample(self, t: FloatArray) -> FloatArray:
        """See `Disturbance.sample`."""
        frequency = np.atleast_1d(np.asarray(self.frequency))
        torque: FloatArray = self.amplitude * np.cos(np.multiply.outer(t, frequency) + self.phase)
        return torque


@described("pulse", "Disturbance")
@dataclass(frozen=True, eq=False)
class Pulse(Description):
    """A constant torque from `start` until just before `end`.

    Parameters
    ----------
    torque
        Scalar or (n,) [N m].
    start, end
        [s]; the whole run if not given.
    """

    torque: Annotated[ArrayLike, PerJoint("N m")]
    start: Annotated[float, Number("s")] = 0.0
    end: Annotated[float, Number("s", finite=False)] = np.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.end <= self.start:
            expected = f"more than start ({self.start:g})"
            raise ArgumentError("disturbance.end", expected, self.end)

    def sample(self, t: FloatArray) -> FloatArray:
        """See `Disturbance.sample`."""
        # A sample may fall a rounding error before the instant it stands for.
        slack = 1e-9
        on = (t >= self.start - slack) & (t < self.end - slack)
        torque = np.atleast_1d(np.asarray(self.torque))
        pulse: FloatArray = np.multiply.outer(on.astype(np.float64), torque)
        return pulse


@described("sum", "Disturbance")
@dataclass(frozen=True, eq=False)
class Sum(Description):
    """Several disturbances at once.

    Parameters
    ----------
    parts
        At least one.
    """

    parts: Sequence[Disturbance]

    def __post_init__(self) -> None:
        super().__post_init__()
        if not self.parts:
            raise ArgumentError("disturbance.parts", "at least one disturbance", "none")

    def sample(self, t: FloatArray) -> FloatArray:
        """See `Disturbance.sample`."""
        total = self.parts[0].sample(t)
        for part in self.parts[1:]:
            total = total + part.sample(t)
        return total
