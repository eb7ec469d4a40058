"""What a cost is: one number for a run, of its metrics or of its rows as they stream by."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from fpid_pin.checks import FloatArray
from fpid_pin.costs.figures import Metrics
from fpid_pin.descriptions import Description
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown


class Cost(Description, ABC):
    """One number for a run, to be made small; a run that diverges costs +inf."""

    _path = "cost"

    @abstractmethod
    def of(self, metrics: Metrics) -> float:
        """Return the cost of a completed run."""

    def streamed(self) -> RowCost | None:
        """Return what takes the run's rows in place of `of`; None: its metrics are enough."""
        return None


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
