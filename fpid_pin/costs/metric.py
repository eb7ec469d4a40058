"""Costs made of a run's metrics; eq. (33) and its kin."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, OneOf, PerJoint
from fpid_pin.costs.cost import Cost
from fpid_pin.costs.figures import METRIC_NAMES, REDUCTIONS, Metrics, over_joints
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError


def _weighted(metric: FloatArray, weights: ArrayLike) -> FloatArray:
    array = np.asarray(weights)
    if array.ndim and array.shape != metric.shape:
        raise ArgumentError("joint_weights", f"shape {metric.shape}", f"{array.shape}")
    return np.asarray(array * metric)


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

    w1: Annotated[float, Number(low=0.0)] = 1.0
    w2: Annotated[float, Number(low=0.0)] = 1e-4
    joint_weights: Annotated[ArrayLike, PerJoint(low=0.0)] = 1.0

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        each = _weighted(self.w1 * metrics.ise + self.w2 * metrics.energy, self.joint_weights)
        return float(np.add.reduce(each))


@described("metric_cost")
@dataclass(frozen=True, eq=False)
class MetricCost(Cost):
    """A metric itself, ``iae``, ``settling_time``, ..., over the joints.

    Parameters
    ----------
    metric
        A field of `Metrics`.
    joint_weights
        Scalar or (n,).
    joints
        ``"sum"`` over them, the ``"worst"`` one's, or their root mean square, ``"rms"``.
    """

    metric: Annotated[str, OneOf(*METRIC_NAMES)]
    joint_weights: Annotated[ArrayLike, PerJoint(low=0.0)] = 1.0
    joints: Annotated[str, OneOf(*REDUCTIONS)] = "sum"

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        each = _weighted(getattr(metrics, self.metric), self.joint_weights)
        return over_joints(each, self.joints)
