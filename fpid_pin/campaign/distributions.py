"""How an uncertain number is spread: what a point of [0, 1] stands for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import Flag, FloatArray, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError

#: Half a cell of the grid that Sobol points lie on: a normal quantile of 0 is -inf.
_EDGE = 2.0**-31


@dataclass(frozen=True, eq=False)
class Distribution(Description, ABC):
    """The spread of one quantity; its numbers are those of all joints, or (n,), one a joint.

    Parameters
    ----------
    shared
        Whether all joints have the same number; else each has its own, independently.
    """

    _possible: ClassVar[tuple[str, ...]] = ("low", "high")

    shared: Annotated[bool, Flag] = False

    @abstractmethod
    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """Return the values at `u` in [0, 1], (runs, numbers), none beyond [`low`, `high`]."""

    def numbers(self) -> dict[str, FloatArray]:
        """Return by field the numbers that have to be possible values themselves."""
        return {name: np.asarray(getattr(self, name)) for name in self._possible}


def _ordered(low: FloatArray, high: FloatArray) -> None:
    if not (low < high).all():
        raise ArgumentError("high", f"more than low ({low.tolist()})", high.tolist())


@described("uniform")
@dataclass(frozen=True, eq=False, kw_only=True)
class Uniform(Distribution):
    """Equally likely from `low` to `high`."""

    low: Annotated[ArrayLike, PerJoint()]
    high: Annotated[ArrayLike, PerJoint()]

    def __post_init__(self) -> None:
        super().__post_init__()
        _ordered(np.asarray(self.low), np.asarray(self.high))

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(a + (b - a) * u)


@described("log_uniform")
@dataclass(frozen=True, eq=False, kw_only=True)
class LogUniform(Distribution):
    """Its logarithm is equally likely from that of `low` to that of `high`, both positive."""

    low: Annotated[ArrayLike, PerJoint(above=0.0)]
    high: Annotated[ArrayLike, PerJoint(above=0.0)]

    def __post_init__(self) -> None:
        super().__post_init__()
        _ordered(np.asarray(self.low), np.asarray(self.high))

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        a, b = np.asarray(self.low), np.asarray(self.high)
        return np.asarray(np.clip(a * (b / a) ** u, a, b))


@described("normal")
@dataclass(frozen=True, eq=False, kw_only=True)
class Normal(Distribution):
    """A normal distribution; where the quantity has limits it is cut there, and what is left is 1.

    Parameters
    ----------
    mean, std
        Of the distribution before it is cut.
    """

    _possible = ("mean",)

    mean: Annotated[ArrayLike, PerJoint()]
    std: Annotated[ArrayLike, PerJoint(above=0.0)]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        # Imported late: scipy is heavy.
        from scipy.special import ndtr, ndtri

        mean, std = np.asarray(self.mean), np.asarray(self.std)
        first, last = ndtr((low - mean) / std), ndtr((high - mean) / std)
        part = first + np.clip(u, _EDGE, 1.0 - _EDGE) * (last - first)
        return np.asarray(np.clip(mean + std * ndtri(part), low, high))


@described("choices")
@dataclass(frozen=True, eq=False, kw_only=True)
class Choices(Distribution):
    """One of several `values`, equally likely; the same list for every joint."""

    _possible = ("values",)

    values: Annotated[ArrayLike, PerJoint()]

    def quantile(self, u: FloatArray, low: float, high: float) -> FloatArray:
        """See `Distribution.quantile`."""
        values = np.atleast_1d(np.asarray(self.values))
        place = np.minimum((u * len(values)).astype(np.int64), len(values) - 1)
        return np.asarray(values[place])
