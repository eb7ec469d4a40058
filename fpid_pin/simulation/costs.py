"""Costs: one number for a run, made of its metrics; eq. (33) and its kin."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.simulation.metrics import Metrics


class Cost(ABC):
    """One number for a run, to be made small; a run that diverges costs +inf.

    Attributes
    ----------
    needs
        The metrics that it is made of; no others are then computed.
    """

    needs: Sequence[str]

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

    needs = ("ise", "energy")

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

    @property
    def needs(self) -> Sequence[str]:  # type: ignore[override]
        """See `Cost`."""
        return (self.metric,)

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        return _weighted(getattr(metrics, self.metric), self.joint_weights)
