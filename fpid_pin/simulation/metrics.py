"""Figures of merit, per joint: the same sums for a recorded run and for one that streams by."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.costs import SETTLING_BAND, Cost, Metrics, RowCost, Rows
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.blocks import BLOCK_ROWS, MOTION


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
    applied = slice(0, planned)
    q, q_ref, torque = (
        np.ascontiguousarray(getattr(run, name)[applied]) for name in ("q", "q_ref", "torque")
    )
    measure(sums, q, q_ref, torque, planned // 2, run.step)
    return metrics_from(sums, planned, run.step)


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
