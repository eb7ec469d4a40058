"""A spline through poses at given times."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import Array, FloatArray, OneOf
from fpid_pin.descriptions import Description, described
from fpid_pin.references.reference import Motion
from fpid_pin.references.splines import Rows, Splines, check_points, held, with_derivatives


@described("waypoints", "Reference")
@dataclass(frozen=True, eq=False)
class Waypoints(Description):
    """Through poses at given times, at rest at both ends, by a spline of scipy.

    Parameters
    ----------
    times
        [s], (K,), increasing; before the first and after the last it holds.
    positions
        [rad], (K, n).
    method
        ``"cubic"``: continuous acceleration inside, a jump of it at the ends; ``"quintic"``:
        continuous jerk inside and no acceleration at the ends.

    Raises
    ------
    ArgumentError
        Times that do not increase, fewer than two points, rows of other lengths.
    """

    times: Annotated[ArrayLike, Array("s", shape=(None,))]
    positions: Annotated[ArrayLike, Rows("rad")]
    method: Annotated[str, OneOf("cubic", "quintic")] = "cubic"

    def __post_init__(self) -> None:
        super().__post_init__()
        check_points(np.asarray(self.times), np.asarray(self.positions))

    @cached_property
    def _splines(self) -> Splines:
        times, positions = np.asarray(self.times), np.asarray(self.positions)
        # Imported here: scipy.interpolate would be a third of the package's import time.
        from scipy.interpolate import CubicSpline, make_interp_spline

        if self.method == "cubic":
            spline = CubicSpline(times, positions, axis=0, bc_type="clamped")
        else:
            still = np.zeros(positions.shape[1])
            rest = [(1, still), (2, still)]
            spline = make_interp_spline(times, positions, k=5, bc_type=(rest, rest))
        return with_derivatives(spline)

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        return held(t, np.asarray(self.times), self._splines)
