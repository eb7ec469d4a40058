"""Costs: one number for a run, of its metrics, eq. (33) and its kin, or of its rows."""

from __future__ import annotations

import copy
import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin.checks import FloatArray, Number, OneOf, PerJoint
from fpid_pin.costs.metrics import METRICS, REDUCTIONS, SETTLING_BAND, Metrics, over_joints
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

#: Arrays of the motion of every run, (N, n) each.
MOTION = ("q", "v", "q_ref", "v_ref", "torque")
#: Rows handed on at a time: enough that what Python does for a block does not count.
BLOCK_ROWS = 4096


class Cost(Description, ABC):
    """One number for a run, to be made small; a run that diverges costs +inf."""

    _path = "cost"

    @abstractmethod
    def of(self, metrics: Metrics) -> float:
        """Return the cost of a completed run."""

    def streamed(self) -> RowCost | None:
        """Return what takes the run's rows in place of `of`; None: its metrics are enough."""
        return None


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

    metric: Annotated[str, OneOf(*METRICS)]
    joint_weights: Annotated[ArrayLike, PerJoint(low=0.0)] = 1.0
    joints: Annotated[str, OneOf(*REDUCTIONS)] = "sum"

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        each = _weighted(getattr(metrics, self.metric), self.joint_weights)
        return over_joints(each, self.joints)


@described("tracking_cost")
@dataclass(frozen=True, eq=False)
class TrackingCost(Cost):
    """``I = max_j rms_tail_j max(1, V/limit)^2``: tracking, while the torque stays quiet.

    V is the total variation of all joints' torques. An error alone can always be made smaller by
    gains that turn noise into torque; by the square of the excess that never pays.

    Parameters
    ----------
    variation_limit
        [N m]; inf: none.
    """

    variation_limit: Annotated[float, Number("N m", above=0.0, finite=False)] = np.inf

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        excess = float(np.add.reduce(metrics.total_variation)) / self.variation_limit
        return float(np.max(metrics.rms_tail)) * max(1.0, excess) ** 2


@dataclass(frozen=True, eq=False)
class Rows:
    """Some consecutive rows of one run, K of them, whose torque was applied.

    Attributes
    ----------
    first
        Number of the first of them in its run.
    step
        Sampling period [s].
    t
        (K,) [s].
    q, v, q_ref, v_ref
        Joint angles, rates and their references [rad], [rad/s], (K, n).
    torque
        What the drives gave [N m], (K, n).
    signals
        Those of the law that the cost has asked for, (K, n) or (K,).
    limit
        Of the torque, (n,) [N m].
    arm
        The nominal `Arm`.
    """

    first: int
    step: float
    t: FloatArray
    q: FloatArray
    v: FloatArray
    q_ref: FloatArray
    v_ref: FloatArray
    torque: FloatArray
    signals: Mapping[str, FloatArray]
    limit: FloatArray
    arm: Any

    @property
    def error(self) -> FloatArray:
        """``e = q_d - q`` [rad], (K, n)."""
        return self.q_ref - self.q


class RowCost(Cost):
    """A cost of the rows themselves, which come a block at a time and are not kept.

    How many come at once is not promised. `add` may change the state that it was given.

    Attributes
    ----------
    signals
        Of the law, by name, that `add` needs.
    """

    signals: Sequence[str] = ()

    @abstractmethod
    def begin(self) -> Any:
        """Return the state of a run of which no row has come."""

    @abstractmethod
    def add(self, state: Any, rows: Rows) -> Any:
        """Return the state with these rows."""

    @abstractmethod
    def finish(self, state: Any) -> float:
        """Return the cost of a completed run."""

    def streamed(self) -> RowCost | None:
        """See `Cost.streamed`."""
        return self

    def of(self, metrics: Metrics) -> float:
        """Refuse: metrics do not have it."""
        raise ArgumentError("cost", "a run (simulation.cost_of) or evaluate", "a run's metrics")


@dataclass(frozen=True, eq=False, repr=False)
class FromRows(RowCost):
    """A cost made of functions.

    For worker processes the functions must be found by name: those of a module, not lambdas. A
    search's checkpoint knows them by their names alone.

    Parameters
    ----------
    start
        The state before the first row; every run has a copy of its own.
    step
        ``step(state, rows)`` returns the state with `Rows` more.
    value
        ``value(state)`` returns the cost; None: the state is it.
    signals
        As in `RowCost`: ``("u_fpid",)``.
    """

    start: Any
    step: Callable[[Any, Rows], Any]
    value: Callable[[Any], float] | None = None
    signals: Sequence[str] = ()

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, given in (("step", self.step), ("value", self.value)):
            if not callable(given) and not (name == "value" and given is None):
                raise ArgumentError(f"cost.{name}", "a function", shown(given))
        names = (self.signals,) if isinstance(self.signals, str) else tuple(self.signals)
        self._set(signals=names)

    def begin(self) -> Any:
        """See `RowCost.begin`."""
        return copy.deepcopy(self.start)

    def add(self, state: Any, rows: Rows) -> Any:
        """See `RowCost.add`."""
        return self.step(state, rows)

    def finish(self, state: Any) -> float:
        """See `RowCost.finish`."""
        return state if self.value is None else self.value(state)

    def __repr__(self) -> str:
        # Without addresses: a checkpoint compares it.
        step, value = (
            f and f"{f.__module__}.{getattr(f, '__qualname__', type(f).__qualname__)}"
            for f in (self.step, self.value)
        )
        return f"FromRows({shown(self.start)}, {step}, {value}, {self.signals!r})"


@described("tool_cost")
@dataclass(frozen=True, eq=False)
class ToolCost(RowCost):
    """How far the tool is from where the reference would have it [m], by the nominal arm.

    Parameters
    ----------
    measure
        ``"rms"`` over the rows, or their ``"peak"``.
    """

    measure: Annotated[str, OneOf("rms", "peak")] = "rms"

    def begin(self) -> tuple[int, float, float]:
        """See `RowCost.begin`: rows, sum of squares [m^2] and largest square [m^2]."""
        return 0, 0.0, 0.0

    def add(self, state: tuple[int, float, float], rows: Rows) -> tuple[int, float, float]:
        """See `RowCost.add`."""
        count, total, worst = state
        squares = tool_distance(rows.arm, rows.q, rows.q_ref) ** 2
        return count + len(squares), total + float(squares.sum()), max(worst, float(squares.max()))

    def finish(self, state: tuple[int, float, float]) -> float:
        """See `RowCost.finish`."""
        count, total, worst = state
        return float(np.sqrt(total / count if self.measure == "rms" else worst))


def tool_distance(arm: Any, q: FloatArray, q_ref: FloatArray) -> FloatArray:
    """Return how far the tool of an `Arm` at `q` is from that at `q_ref`, (K, n) both, (K,) [m]."""
    import pinocchio as pin

    # Without `Arm.tool_pose`, whose checks take longer than the kinematics of a row.
    model, data = arm.model, arm.model.createData()
    frame = model.getFrameId(arm.tool)

    def places(angles: FloatArray) -> FloatArray:
        found = np.empty((len(angles), 3))
        for row, pose in zip(found, angles, strict=True):
            pin.forwardKinematics(model, data, pose)
            row[:] = pin.updateFramePlacement(model, data, frame).translation
        return found

    return np.asarray(np.linalg.norm(places(q) - places(q_ref), axis=1))


@described("settling_cost")
@dataclass(frozen=True, eq=False)
class SettlingCost(RowCost):
    """When all joints are within a band for good [s]; the whole duration where they are not.

    Parameters
    ----------
    band
        [rad].
    """

    band: Annotated[float, Number("rad", above=0.0)] = SETTLING_BAND

    def begin(self) -> float:
        """See `RowCost.begin`."""
        return 0.0

    def add(self, state: float, rows: Rows) -> float:
        """See `RowCost.add`."""
        outside = np.flatnonzero((np.abs(rows.error) > self.band).any(axis=1))
        return (rows.first + int(outside[-1]) + 1) * rows.step if outside.size else state

    def finish(self, state: float) -> float:
        """See `RowCost.finish`."""
        return state


class RowCosts:
    """Costs of a run's rows, which stream by: of its first `applied`, all but the last."""

    def __init__(self, costs: Sequence[RowCost], applied: int) -> None:
        self._costs, self._applied = costs, applied
        self._wanted = sorted({name for cost in costs for name in cost.signals})
        self._states = [cost.begin() for cost in costs]

    def take(self, rows: Rows) -> None:
        """Take the next rows."""
        missing = [name for name in self._wanted if name not in rows.signals]
        if missing:
            has = ", ".join(sorted(rows.signals)) or "none"
            raise ArgumentError("cost.signals", f"signals of the law ({has})", missing[0])
        count = max(min(len(rows.q), self._applied - rows.first), 0)
        if not count:
            return
        # Copies: a cost may keep them, and the engine uses its arrays again.
        own = {name: getattr(rows, name)[:count].copy() for name in ("t", *MOTION)}
        signals = {name: rows.signals[name][:count].copy() for name in self._wanted}
        rows = dataclasses.replace(rows, **own, signals=signals)
        self._states = [
            cost.add(state, rows) for cost, state in zip(self._costs, self._states, strict=True)
        ]

    def results(self) -> list[float]:
        """Return what the run costs, by each of the costs."""
        found = []
        for cost, state in zip(self._costs, self._states, strict=True):
            value = cost.finish(state)
            try:
                found.append(float(value))
            except (TypeError, ValueError):
                raise ArgumentError("cost", "a number", type(value).__name__) from None
        return found


def cost_of(run: Any, cost: Cost) -> float:
    """Return the cost of a recorded `Run`, as `evaluate` gives it; +inf where it diverged."""
    if not run.outcome.completed:
        return float("inf")
    streamed = cost.streamed()
    if streamed is None:
        return cost.of(run.metrics)
    costs = RowCosts([streamed], run.planned_rows - 1)
    limit = np.array(run.meta["effort_limit"])
    for first in range(0, len(run.t), BLOCK_ROWS):
        part = slice(first, first + BLOCK_ROWS)
        own = {name: getattr(run, name)[part] for name in ("t", *MOTION)}
        signals = {name: array[part] for name, array in run.signals.items()}
        costs.take(Rows(first, run.step, **own, signals=signals, limit=limit, arm=run.arm))
    return costs.results()[0]
