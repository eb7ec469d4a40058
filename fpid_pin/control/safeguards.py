"""What keeps adapted gains bounded; the adaptation itself, eqs. (30)-(32), is `control.fpid`."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described


@described("safeguards")
@dataclass(frozen=True, eq=False)
class Safeguards:
    """Ways of keeping adapted gains bounded; none is on in the paper's experiment.

    The gradient law alone drifts: under a constant load ``Ki' = gamma k0 (int e)^2 >= 0``, so
    gains grow slowly for ever, and with noise faster.

    Parameters
    ----------
    minimum, maximum
        Projection: each of Kp, Ki, Kd stays within, initial ones included; scalars, (n,) or
        (3, n).
    sigma
        Leakage towards the initial gains [1/s]: ``K' = ... - sigma (K - K(0))``
        (Ioannou and Kokotovic 1984).
    e_modification
        Leakage in proportion to the surface: ``K' = ... - gamma nu |S| (K - K(0))``
        (Narendra and Annaswamy 1987).
    dead_zone
        No adaptation while ``|S|`` is below it; beyond, only the excess counts.
    """

    minimum: ArrayLike = 0.0
    maximum: ArrayLike = np.inf
    sigma: float = 0.0
    e_modification: float = 0.0
    dead_zone: float = 0.0

    def __post_init__(self) -> None:
        low = checks.floats("safeguards.minimum", self.minimum, max_ndim=2)
        high = checks.floats("safeguards.maximum", self.maximum, low=0, finite=False, max_ndim=2)
        if np.any(low > high):
            raise checks.ArgumentError(
                "safeguards.minimum", "at most safeguards.maximum", f"{low.max():g}"
            )
        object.__setattr__(self, "minimum", low)
        object.__setattr__(self, "maximum", high)
        for name in ("sigma", "e_modification", "dead_zone"):
            value = checks.number(f"safeguards.{name}", getattr(self, name), low=0)
            object.__setattr__(self, name, value)

    @staticmethod
    def bounds_of(guard: Safeguards | None, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the least and the largest Kp, Ki, Kd of an arm with n joints, (3, n) each."""
        if guard is None:
            return np.full((3, n), -np.inf), np.full((3, n), np.inf)
        return _bound("minimum", guard.minimum, n), _bound("maximum", guard.maximum, n)


def _bound(name: str, value: ArrayLike, n: int) -> FloatArray:
    array = np.asarray(value, dtype=np.float64)
    if array.ndim and array.shape not in ((n,), (3, n)):
        expected = f"shape ({n},) or (3, {n})"
        raise checks.ArgumentError(f"safeguards.{name}", expected, f"shape {array.shape}")
    return np.broadcast_to(array, (3, n))
