"""Disturbance torques: d(t) in M q'' = U - C q' - G + d(t), after eq. (35)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described

__all__ = ["Cosine", "Disturbance", "Pulse", "Sum"]


@runtime_checkable
class Disturbance(Protocol):
    """A torque on the joints of one robot; anything with this method will do."""

    def sample(self, t: FloatArray) -> FloatArray:
        """Return d [N m] at times `t` [s], (K,), as (K, n) or (K, 1)."""
        ...


@described("cosine", "Disturbance")
@dataclass(frozen=True, eq=False)
class Cosine:
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

    amplitude: ArrayLike
    frequency: ArrayLike = 5.0 * np.pi
    phase: ArrayLike = 0.0

    def __post_init__(self) -> None:
        for name in ("amplitude", "frequency", "phase"):
            array = checks.floats(f"disturbance.{name}", getattr(self, name), max_ndim=1)
            object.__setattr__(self, name, array)

    def sample(self, t: FloatArray) -> FloatArray:
        """See `Disturbance.sample`."""
        frequency = np.atleast_1d(np.asarray(self.frequency))
        torque: FloatArray = self.amplitude * np.cos(np.multiply.outer(t, frequency) + self.phase)
        return torque


@described("pulse", "Disturbance")
@dataclass(frozen=True, eq=False)
class Pulse:
    """A constant torque from `start` until just before `end`.

    Parameters
    ----------
    torque
        Scalar or (n,) [N m].
    start, end
        [s]; the whole run if not given.
    """

    torque: ArrayLike
    start: float = 0.0
    end: float = np.inf

    def __post_init__(self) -> None:
        array = checks.floats("disturbance.torque", self.torque, max_ndim=1)
        object.__setattr__(self, "torque", array)
        start = checks.number("disturbance.start", self.start)
        end = checks.number("disturbance.end", self.end, finite=False)
        if end <= start:
            raise checks.ArgumentError("disturbance.end", f"more than start ({start:g})", end)
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)

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
class Sum:
    """Several disturbances at once.

    Parameters
    ----------
    parts
        At least one.
    """

    parts: Sequence[Disturbance]

    def __post_init__(self) -> None:
        if not self.parts:
            raise checks.ArgumentError("disturbance.parts", "at least one disturbance", "none")
        for part in self.parts:
            checks.instance("disturbance.parts", part, Disturbance, "disturbances")
        object.__setattr__(self, "parts", tuple(self.parts))

    def sample(self, t: FloatArray) -> FloatArray:
        """See `Disturbance.sample`."""
        total = self.parts[0].sample(t)
        for part in self.parts[1:]:
            total = total + part.sample(t)
        return total
