"""Figures of merit, per joint: the same sums for a recorded run and for one that streams by."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, get_type_hints

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray

#: Errors within it count as settled, where no other band is given [rad].
SETTLING_BAND = 0.01
#: Words for what becomes of the joints' figures: their sum, their largest, their root mean square.
REDUCTIONS = ("sum", "worst", "rms")


@dataclass(frozen=True)
class Metric:
    """What a figure of merit is, and how those of all joints become one.

    Parameters
    ----------
    unit
        Its unit for a joint that turns (`text.unit_for` has that of others).
    joints
        One of `REDUCTIONS`.
    meaning
        In words; e = q_d - q, u the torque that was applied.
    """

    unit: str
    joints: str
    meaning: str

    def of(self, values: FloatArray) -> float:
        """Return the one number of all joints' figures, (n,)."""
        return over_joints(values, self.joints)


# fmt: off
@dataclass(frozen=True, eq=False)
class Metrics:
    """Figures of merit of one run, (n,) each; e = q_d - q, u the torque that was applied.

    Integrals are h times the sum over the rows whose torque was applied, that is all but the last
    of a completed run. Each field has its `Metric`: see `METRICS`.
    """

    ise: Annotated[FloatArray, Metric("rad² s", "sum", "integral of e^2")]
    iae: Annotated[FloatArray, Metric("rad s", "sum", "integral of |e|")]
    itae: Annotated[FloatArray, Metric("rad s²", "sum", "integral of t |e|")]
    rms: Annotated[FloatArray, Metric("rad", "rms", "root mean square of e")]
    rms_tail: Annotated[FloatArray, Metric("rad", "rms",
        "the same over the planned last half; NaN for a run that ended earlier")]
    energy: Annotated[FloatArray, Metric("N²m²s", "sum", "integral of u^2")]
    total_variation: Annotated[FloatArray, Metric("N m", "sum", "sum of |u_k - u_(k-1)|")]
    peak_torque: Annotated[FloatArray, Metric("N m", "worst", "largest |u|")]
    peak_error: Annotated[FloatArray, Metric("rad", "worst", "largest |e|")]
    settling_time: Annotated[FloatArray, Metric("s", "worst",
        "from when on |e| <= SETTLING_BAND to the end; 0 where it always was, inf where it is "
        "beyond at the end, or where the run ended early")]
    overshoot: Annotated[FloatArray, Metric("rad", "worst",
        "largest error on the side opposite to the one at the start, that is, how far beyond the "
        "reference the joint went; 0 where it starts within the band")]
    saturated: Annotated[FloatArray, Metric("share of time", "worst",
        "share of the rows whose torque is at its limit, the least of the law's and the drives'")]
    torque_rate: Annotated[FloatArray, Metric("N m/s", "worst",
        "root mean square of (u_k - u_(k-1))/h: what the arm feels as jerk, which is M^-1 times "
        "the torque's rate, but for smoother terms")]
# fmt: on


#: Every metric by the name of its field: its unit, its meaning, how the joints' become one.
METRICS: dict[str, Metric] = {
    name: hint.__metadata__[0]
    for name, hint in get_type_hints(Metrics, include_extras=True).items()
}


def over_joints(values: FloatArray, how: str) -> float:
    """Return one number for a figure of all joints, (n,); `how`: one of `REDUCTIONS`."""
    if how == "worst":
        return float(np.max(values))
    if how == "rms":
        return float(np.sqrt(np.add.reduce(values**2) / len(values)))
    return float(np.add.reduce(values))


def metrics_from(sums: Any, planned: int, step: float) -> Metrics:
    """Return the metrics of sums, `kernels.records.MEASURE`, of a run of `planned` + 1 rows."""
    h = step
    stayed = (sums["rows"] == planned) & (sums["settled"] < sums["rows"])
    with np.errstate(divide="ignore", invalid="ignore"):
        return Metrics(
            ise=h * sums["square"],
            iae=h * sums["absolute"],
            itae=h * sums["aged"],
            rms=np.sqrt(sums["square"] / sums["rows"]),
            rms_tail=np.sqrt(sums["late"] / sums["late_rows"]),
            energy=h * sums["effort"],
            total_variation=sums["changes"].copy(),
            peak_torque=sums["peak"].copy(),
            peak_error=sums["worst"].copy(),
            settling_time=np.where(stayed, h * sums["settled"], np.inf),
            overshoot=np.where(np.abs(sums["start"]) > sums["band"], sums["beyond"], 0.0),
            saturated=sums["at_limit"] / sums["rows"],
            torque_rate=np.sqrt(sums["jumps"] / (sums["rows"] - 1)) / h,
        )


def metrics_of(run: Any, band: float = SETTLING_BAND) -> Metrics:
    """Return the metrics of a recorded run: the same bits as while it ran.

    Parameters
    ----------
    run
        A `Run` of any origin.
    band
        Within which the error counts as settled [rad].
    """
    # Imported late: it loads numba.
    from fpid_pin.kernels.metrics import measure_rows
    from fpid_pin.kernels.records import MEASURE

    measure: Any = measure_rows
    planned = run.planned_rows - 1
    sums = np.zeros(run.q.shape[1], MEASURE)
    sums["band"] = checks.number("band", band, above=0.0)
    sums["limit"] = run.meta["effort_limit"]
    motion = np.stack([getattr(run, name)[:planned] for name in ("q", "v", "torque")])
    reference = np.array(run.q_ref[np.newaxis, :planned])
    measure(sums, reference, motion, planned // 2, run.step)
    return metrics_from(sums, planned, run.step)
