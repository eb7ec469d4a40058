"""Figures of merit of a run, per joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fpid_pin.checks import FloatArray

#: Errors within it count as settled, where no other band is given [rad].
SETTLING_BAND = 0.01


@dataclass(frozen=True, eq=False)
class Metrics:
    """Figures of merit of one run, (n,) each; e = q_d - q, u the torque that was applied.

    Integrals are h times the sum over the rows whose torque was applied, that is all but the last
    of a completed run.

    Attributes
    ----------
    ise, iae, itae
        Integrals of e^2 [rad^2 s], |e| [rad s] and t |e| [rad s^2].
    rms, rms_tail
        Root mean square of e over the run and over its planned last half [rad]; the latter is NaN
        for a run that ended earlier.
    energy
        Integral of u^2 [(N m)^2 s].
    total_variation
        Sum of |u_k - u_(k-1)| [N m].
    peak_torque
        Largest |u| [N m].
    peak_error
        Largest |e| [rad].
    settling_time
        From when on |e| <= `SETTLING_BAND` to the end [s]; 0 where it always was, inf where it is
        beyond at the end, or where the run ended early.
    overshoot
        Largest error on the side opposite to the one at the start, that is, how far beyond the
        reference the joint went [rad]; 0 where it starts within the band.
    saturated
        Share of the rows whose torque is at its limit, the least of the law's and the drives', in
        [0, 1].
    torque_rate
        Root mean square of (u_k - u_(k-1))/h [N m/s]: what the arm feels as jerk, which is M^-1
        times the torque's rate, but for smoother terms.
    """

    ise: FloatArray
    iae: FloatArray
    itae: FloatArray
    rms: FloatArray
    rms_tail: FloatArray
    energy: FloatArray
    total_variation: FloatArray
    peak_torque: FloatArray
    peak_error: FloatArray
    settling_time: FloatArray
    overshoot: FloatArray
    saturated: FloatArray
    torque_rate: FloatArray


METRIC_NAMES = tuple(Metrics.__dataclass_fields__)
#: Words for what becomes of the joints' figures: their sum, their largest, their root mean square.
REDUCTIONS = ("sum", "worst", "rms")


def over_joints(values: FloatArray, how: str) -> float:
    """Return one number for a figure of all joints, (n,); `how`: one of `REDUCTIONS`."""
    if how == "worst":
        return float(np.max(values))
    if how == "rms":
        return float(np.sqrt(np.add.reduce(values**2) / len(values)))
    return float(np.add.reduce(values))
