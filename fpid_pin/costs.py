"""What a run is worth: figures of merit of each joint, and costs, one number for a run."""

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray, Number, OneOf, PerJoint
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

__all__ = [
    "METRICS", "REDUCTIONS", "SETTLING_BAND", "Cost", "FromRows", "Metric", "MetricCost", "Metrics",
    "QuadraticCost", "RowCost", "Rows", "SettlingCost", "ToolCost", "TrackingCost", "over_joints",
    "tool_distance",
]  # fmt: skip

#: Errors within it count as settled, where no other band is given [rad].
SETTLING_BAND = 0.01
#: Words for what becomes of the joints' figures: their sum, their largest, their root mean square.
REDUCTIONS = ("sum", "worst", "rms")


@dataclass(frozen=True)
class Metric:
    """What a figure of merit is, and how those of all joints become one."""

    word: str  # in the head of a column
    unit: str  # for a joint that turns; `text.unit_for` has that of others
    joints: str  # one of `REDUCTIONS`
    meaning: str  # e = q_d - q, u the torque that was applied

    @property
    def scale(self) -> float:
        """By what a table multiplies it: shares are shown in percent."""
        return 100.0 if self.unit == "share of time" else 1.0

    @property
    def head(self) -> str:
        """Its column's head in a table of joints."""
        return f"{self.word} [{self.unit if self.scale == 1.0 else '%'}]"

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

    rms: Annotated[FloatArray, Metric("RMS", "rad", "rms", "root mean square of e")]
    rms_tail: Annotated[FloatArray, Metric("RMS tail", "rad", "rms",
        "the same over the planned last half; NaN for a run that ended earlier")]
    ise: Annotated[FloatArray, Metric("ISE", "rad² s", "sum", "integral of e^2")]
    iae: Annotated[FloatArray, Metric("IAE", "rad s", "sum", "integral of |e|")]
    itae: Annotated[FloatArray, Metric("ITAE", "rad s²", "sum", "integral of t |e|")]
    energy: Annotated[FloatArray, Metric("energy", "N²m²s", "sum", "integral of u^2")]
    total_variation: Annotated[FloatArray, Metric("variation", "N m", "sum",
        "sum of |u_k - u_(k-1)|")]
    peak_torque: Annotated[FloatArray, Metric("peak torque", "N m", "worst", "largest |u|")]
    peak_error: Annotated[FloatArray, Metric("peak error", "rad", "worst", "largest |e|")]
    settling_time: Annotated[FloatArray, Metric("settled", "s", "worst",
        "from when on |e| <= SETTLING_BAND to the end; 0 where it always was, inf where it is "
        "beyond at the end, or where the run ended early")]
    overshoot: Annotated[FloatArray, Metric("overshoot", "rad", "worst",
        "largest error on the side opposite to the one at the start, that is, how far beyond the "
        "reference the joint went; 0 where it starts within the band")]
    saturated: Annotated[FloatArray, Metric("at its limit", "share of time", "worst",
        "share of the rows whose torque is at its limit, the least of the law's and the drives'")]
    torque_rate: Annotated[FloatArray, Metric("torque rate", "N m/s", "worst",
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

    def streamed(self) -> "RowCost | None":
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
        ``"sum"`` over the joints, the ``"worst"`` joint, or the root mean square, ``"rms"``.
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

    def begin(self) -> Any:
        """Return the state of a run of which no row has come: 0, where nothing else is said."""
        return 0.0

    @abstractmethod
    def add(self, state: Any, rows: Rows) -> Any:
        """Return the state with these rows."""

    def finish(self, state: Any) -> float:
        """Return the cost of a completed run: the state, where nothing else is said."""
        return state  # type: ignore[no-any-return]

    def streamed(self) -> "RowCost | None":
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
        names = checks.several("cost.signals", self.signals, str, "a signal's name")
        self._set(signals=tuple(names))

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

    def add(self, state: float, rows: Rows) -> float:
        """See `RowCost.add`."""
        outside = np.flatnonzero((np.abs(rows.error) > self.band).any(axis=1))
        return (rows.first + int(outside[-1]) + 1) * rows.step if outside.size else state
