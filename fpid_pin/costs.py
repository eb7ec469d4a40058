"""What a run is worth: its metrics, and costs made of them; eq. (33) and its kin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described

__all__ = ["Cost", "MetricCost", "Metrics", "QuadraticCost"]


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
    """

    ise: FloatArray
    iae: FloatArray
    itae: FloatArray
    rms: FloatArray
    rms_tail: FloatArray
    energy: FloatArray
    total_variation: FloatArray
    peak_torque: FloatArray


class Cost(ABC):
    """One number for a run, to be made small; a run that diverges costs +inf."""

    @abstractmethod
    def of(self, metrics: Metrics) -> float:
        """Return the cost of a completed run."""


def _weights(value: ArrayLike) -> FloatArray:
    return checks.floats("joint_weights", value, low=0.0, max_ndim=1)


def _weighted(metric: FloatArray, weights: ArrayLike) -> float:
    array = np.asarray(weights)
    if array.ndim and array.shape != metric.shape:
        raise checks.ArgumentError("joint_weights", f"shape {metric.shape}", f"{array.shape}")
    return float(np.add.reduce(array * metric))


@described("quadratic_cost")
@dataclass(frozen=True, eq=False)
class QuadraticCost(Cost):
    """``I = sum_j c_j int w1 (q_j - q_d,j)^2 + w2 u_j^2 dt``, eq. (33).

    Parameters
    ----------
    w1, w2
        Weights of error and energy. The paper gives none; with 1 and 1e-4 the two weigh about the
        same in its experiment.
    joint_weights
        c, scalar or (n,).
    """

    w1: float = 1.0
    w2: float = 1e-4
    joint_weights: ArrayLike = 1.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "w1", checks.number("cost.w1", self.w1, low=0.0))
        object.__setattr__(self, "w2", checks.number("cost.w2", self.w2, low=0.0))
        object.__setattr__(self, "joint_weights", _weights(self.joint_weights))

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        return _weighted(self.w1 * metrics.ise + self.w2 * metrics.energy, self.joint_weights)


METRIC_NAMES = tuple(Metrics.__dataclass_fields__)


@described("metric_cost")
@dataclass(frozen=True, eq=False)
class MetricCost(Cost):
    """A metric itself, summed over the joints: ``iae``, ``itae``, ``energy``, ...

    Parameters
    ----------
    metric
        A field of `Metrics`.
    joint_weights
        Scalar or (n,).
    """

    metric: str
    joint_weights: ArrayLike = 1.0

    def __post_init__(self) -> None:
        checks.choice("cost.metric", self.metric, METRIC_NAMES)
        object.__setattr__(self, "joint_weights", _weights(self.joint_weights))

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        return _weighted(getattr(metrics, self.metric), self.joint_weights)
