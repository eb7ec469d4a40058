"""What a campaign has found: one row a run, one column a controller."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.extras import needed

#: How a run can end. The first two are a success.
OUTCOMES = ("completed", "saturated", "diverged", "failed")
#: Figures of a run and their units.
METRICS = {
    "rms": "rad",
    "rms_tail": "rad",
    "energy": "N^2 m^2 s",
    "peak_torque": "N m",
    "total_variation": "N m",
}


@dataclass(frozen=True, eq=False)
class CampaignData:
    """Runs 0, 1, 2, ... of a campaign, every controller on the same plants.

    Attributes
    ----------
    title
        Of the campaign.
    seed
        What the samples derive from.
    controllers
        Names, in the order of the columns.
    parameters, units
        Labels of the uncertain numbers (``"payload"``, ``"viscous_friction.0"``) and their units.
    samples
        Their values, (runs, parameters).
    outcome, cause
        One of `OUTCOMES` and, where there is something to say, why: (runs, controllers).
    metrics
        By the names of `METRICS`, (runs, controllers); NaN where a run was not completed. Errors
        are root mean squares over all joints, of the whole run or its last half; energy and
        variation are sums over the joints, the peak is the largest of them.
    dynamics
        Which ones: ``"compiled"`` or ``"pinocchio"``.
    """

    title: str
    seed: int
    controllers: tuple[str, ...]
    parameters: tuple[str, ...]
    units: tuple[str, ...]
    samples: FloatArray
    outcome: NDArray[np.str_]
    cause: NDArray[np.str_]
    metrics: Mapping[str, FloatArray]
    dynamics: str = "compiled"

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.samples)

    @property
    def success(self) -> BoolArray:
        """Whether a run came to its end with finite errors, (runs, controllers)."""
        ended = (self.outcome == "completed") | (self.outcome == "saturated")
        return np.asarray(ended & np.isfinite(self.metrics["rms"]))

    def to_dataframe(self) -> Any:
        """Return a pandas frame, one row a run and controller (extra ``pandas``)."""
        pandas = needed("pandas", "pandas")
        runs, columns = self.outcome.shape
        table: dict[str, Any] = {
            "run": np.repeat(np.arange(runs), columns),
            "controller": np.tile(np.array(self.controllers, dtype=object), runs),
            "outcome": self.outcome.ravel().astype(object),
            "cause": self.cause.ravel().astype(object),
            "dynamics": self.dynamics,
        }
        table |= {name: values.ravel() for name, values in self.metrics.items()}
        for label, values in zip(self.parameters, self.samples.T, strict=True):
            table[label] = np.repeat(values, columns)
        return pandas.DataFrame(table)
