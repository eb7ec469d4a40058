"""What a campaign has found: how each run ended, and all of them as one table."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import costs, npz
from fpid_pin.campaign import statistics
from fpid_pin.checks import BoolArray, Flag, FloatArray, Number, checked
from fpid_pin.costs import Metrics
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.resources import needed
from fpid_pin.simulation import Outcome
from fpid_pin.simulation.comparison import MEASURES
from fpid_pin.text import ReprMixin, head_for, html_table, unit_for

#: How a run can end; the first two have come to their end.
OUTCOMES = ("completed", "saturated", "diverged", "failed")
#: Figures of a run, as `costs.METRICS` has them: the joints' become one each.
METRICS = {
    name: costs.METRICS[name]
    for name in ("rms", "rms_tail", "energy", "peak_torque", "total_variation")
}
#: Lines of a campaign that is printed.
_MOST_LINES = 15


@described("success")
@dataclass(frozen=True, eq=False, kw_only=True)
class Success(Description):
    """When a run of a campaign counts as a success; it must have reached its end.

    Parameters
    ----------
    error
        Largest RMS error of the last half over all joints; inf: any.
    peak_torque
        Largest torque of any joint; None: any.
    at_limits
        Whether a torque may have been at its limit.
    """

    error: Annotated[float, Number("rad", above=0.0, finite=False)] = 0.02
    peak_torque: Annotated[float | None, Number("N m", above=0.0)] = None
    at_limits: Annotated[bool, Flag] = False

    def words(self, angles: Sequence[str]) -> str:
        """Return the criterion in words, for joints whose coordinates have these units."""
        unit = unit_for("mrad", angles)
        parts = [f"RMS error of the last half at most {1e3 * self.error:g} {unit}"]
        parts = parts if np.isfinite(self.error) else []
        if self.peak_torque is not None:
            parts.append(f"torque at most {self.peak_torque:g} {unit_for('N m', angles)}")
        return ", ".join([*parts, *(() if self.at_limits else ("no torque at its limit",))])


#: What every run meets that has come to its end.
ANY = Success(error=np.inf, at_limits=True)


@dataclass(frozen=True)
class Ended:
    """How a run ended under a controller: see `CampaignData`; figures are those of `METRICS`."""

    outcome: str
    cause: str
    figures: tuple[float, ...] = (math.nan,) * len(METRICS)

    @classmethod
    def of(cls, joints: Sequence[str], outcome: Outcome, metrics: Metrics) -> "Ended":
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


@dataclass(frozen=True, eq=False, repr=False)
class CampaignData(ReprMixin):
    """Runs 0, 1, 2, ... of a campaign, every controller on the same plants.

    Printed, it says who is best by how much, who succeeds how often, and how surely.

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
    criterion
        What counts as a success.
    angles
        Units of the joints' coordinates: ``"rad"``, of those that slide ``"m"``.
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
    criterion: Success = ANY
    angles: tuple[str, ...] = ("rad",)

    def unit(self, metric: str) -> str:
        """Return the unit of a metric of these joints."""
        return unit_for(METRICS[metric].unit, self.angles)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.samples)

    @property
    def ended(self) -> BoolArray:
        """Whether a run came to its end with finite errors, (runs, controllers)."""
        ended = (self.outcome == "completed") | (self.outcome == "saturated")
        return np.asarray(ended & np.isfinite(self.metrics["rms"]))

    @property
    def success(self) -> BoolArray:
        """Whether a run meets the criterion, (runs, controllers)."""
        wanted, found = self.criterion, self.metrics
        most = np.inf if wanted.peak_torque is None else wanted.peak_torque
        with np.errstate(invalid="ignore"):
            met = ~(found["rms_tail"] > wanted.error) & ~(found["peak_torque"] > most)
        return np.asarray(self.ended & met & (wanted.at_limits | (self.outcome != "saturated")))

    @property
    def answer(self) -> list[str]:
        """Sentences, the most important first: the best, successes, pairs."""
        return statistics.answer(self)

    def __str__(self) -> str:
        lines = self.answer
        if lines[_MOST_LINES:]:
            lines[_MOST_LINES - 1 :] = [f"... and {len(lines) - _MOST_LINES + 1} lines more."]
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        rows = self.medians()
        return html_table(self.title, list(rows[0]), ([*row.values()] for row in rows))

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
        """Return a row for each controller: successes, medians over all plants, how runs ended.

        A run that was lost counts as worse than any number.
        """
        middle = {
            head_for(m.head, self.angles): m.scale
            * statistics.quantile(statistics.scored(self, m.metric), 0.5)
            for m in MEASURES.values()
            if m.metric in METRICS
        }
        return [
            {"controller": name, "success [%]": 100.0 * float(self.success[:, k].mean())}
            | {head: float(values[k]) for head, values in middle.items()}
            | {end: int(np.sum(self.outcome[:, k] == end)) for end in OUTCOMES}
            for k, name in enumerate(self.controllers)
        ]

    def to_dataframe(self) -> Any:
        """Return the columns as a `pandas.DataFrame` (extra ``pandas``)."""
        return needed("pandas", "pandas").DataFrame(self.columns())


@checked
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
