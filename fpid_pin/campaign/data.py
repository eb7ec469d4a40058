"""What a campaign has found: how each run ended, and all of them as one table."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import costs, npz
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import ArgumentError
from fpid_pin.resources import needed
from fpid_pin.simulation import Outcome

#: How a run can end. The first two are a success.
OUTCOMES = ("completed", "saturated", "diverged", "failed")
#: Figures of a run, as `costs.METRICS` has them: the joints' become one each.
METRICS = {
    name: costs.METRICS[name]
    for name in ("rms", "rms_tail", "energy", "peak_torque", "total_variation")
}


@dataclass(frozen=True)
class Ended:
    """How a run ended under a controller: see `CampaignData`; figures are those of `METRICS`."""

    outcome: str
    cause: str
    figures: tuple[float, ...] = (math.nan,) * len(METRICS)

    @classmethod
    def of(cls, joints: Sequence[str], outcome: Outcome, metrics: Metrics) -> Ended:
        """Return how a run ended, by its outcome and metrics.

        A run that was completed counts as saturated if at any sample a joint's torque was at its
        limit; the cause says which joint the most, and how long.
        """
        if not outcome.completed:
            if outcome.joint:
                return cls("diverged", f"{outcome.joint} at {outcome.time:g} s: {outcome.cause}")
            return cls("failed", f"{outcome.cause} (at {outcome.time:g} s)")
        figures = tuple(metric.of(getattr(metrics, name)) for name, metric in METRICS.items())
        worst = int(np.argmax(np.nan_to_num(metrics.saturated)))
        share = float(metrics.saturated[worst])
        if share > 0.0:
            cause = f"{joints[worst]} at its effort limit {100.0 * share:.3g} % of the time"
            return cls("saturated", cause, figures)
        return cls("completed", "", figures)


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
        are root mean squares over the joints, of the whole run or its last half; energy and
        variation are sums over the joints, the peak is the worst joint's.
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

    def columns(self) -> dict[str, NDArray[Any]]:
        """Return a table by column, a row a run and controller, in the order of both."""
        runs, several = self.outcome.shape
        table: dict[str, Any] = {
            "run": np.repeat(np.arange(runs), several),
            "controller": np.tile(np.array(self.controllers, dtype=object), runs),
            "outcome": self.outcome.ravel().astype(object),
            "cause": self.cause.ravel().astype(object),
            "dynamics": np.full(runs * several, self.dynamics, dtype=object),
        }
        table |= {name: values.ravel() for name, values in self.metrics.items()}
        samples = zip(self.parameters, self.samples.T, strict=True)
        return table | {label: np.repeat(values, several) for label, values in samples}

    def medians(self) -> list[dict[str, Any]]:
        """Return a row for each controller: how its runs ended, and its successes' medians."""
        rows = []
        for k, name in enumerate(self.controllers):
            row: dict[str, Any] = {"controller": name}
            row |= {end: int(np.sum(self.outcome[:, k] == end)) for end in OUTCOMES}
            well = self.success[:, k]
            for figure, values in self.metrics.items():
                middle = float(np.median(values[well, k])) if well.any() else math.nan
                row[f"{figure} [{METRICS[figure].unit}]"] = middle
            rows.append(row)
        return rows

    def to_dataframe(self) -> Any:
        """Return the columns as a `pandas.DataFrame` (extra ``pandas``)."""
        return needed("pandas", "pandas").DataFrame(self.columns())


def export(data: CampaignData, path: str | Path) -> Path:
    """Write the table of a campaign: `CampaignData.columns`, a row a run and controller.

    Numbers have every digit: two campaigns of the same results give the same bytes of CSV.

    Parameters
    ----------
    data
        The campaign.
    path
        The file; its suffix says as what: ``.csv``, or ``.parquet`` (extra ``parquet``).

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        Another suffix.
    FileFormatError
        It cannot be written.
    """
    suffix = Path(path).suffix
    if suffix not in (".csv", ".parquet"):
        raise ArgumentError("file", "a name that ends with .csv or .parquet", Path(path).name)
    return npz.write_columns(path, data.columns(), parquet=suffix == ".parquet")
