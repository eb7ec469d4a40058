"""What keeps adapted gains bounded; the adaptation itself, eqs. (30)-(32), is `control.fpid`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, Number, PerJoint
from fpid_pin.control.parameters import rows_on
from fpid_pin.descriptions import Description, described


@described("safeguards")
@dataclass(frozen=True, eq=False)
class Safeguards(Description):
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

    _path = "safeguards"

    minimum: Annotated[ArrayLike, PerJoint(rows=3)] = 0.0
    maximum: Annotated[ArrayLike, PerJoint(low=0.0, finite=False, rows=3)] = np.inf
    sigma: Annotated[float, Number("1/s", low=0.0)] = 0.0
    e_modification: Annotated[float, Number(low=0.0)] = 0.0
    dead_zone: Annotated[float, Number(low=0.0)] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        low = np.asarray(self.minimum)
        if np.any(low > np.asarray(self.maximum)):
            raise checks.ArgumentError(
                "safeguards.minimum", "at most safeguards.maximum", f"{low.max():g}"
            )

    @staticmethod
    def bounds_of(guard: Safeguards | None, n: int) -> tuple[FloatArray, FloatArray]:
        """Return the least and the largest Kp, Ki, Kd of an arm with n joints, (3, n) each."""
        if guard is None:
            return np.full((3, n), -np.inf), np.full((3, n), np.inf)
        low = rows_on("safeguards.minimum", guard.minimum, 3, n)
        return low, rows_on("safeguards.maximum", guard.maximum, 3, n)
