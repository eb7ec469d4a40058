"""Figures of merit, per joint: the same sums for a recorded run and for rows that stream by."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin import checks
from fpid_pin.costs import SETTLING_BAND, Cost, Metrics
from fpid_pin.simulation.recorders import BLOCK_ROWS, Batch, Block
from fpid_pin.simulation.streamed import RowCosts

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run


class MetricsRecorder:
    """Accumulates what is behind `Metrics`; its memory does not depend on the horizon.

    Parameters
    ----------
    band
        Of the settling time [rad].
    """

    wanted: Sequence[str] = ()

    def __init__(self, band: float = SETTLING_BAND) -> None:
        self._band = checks.number("band", band, above=0.0)

    def start(self, batch: Batch) -> None:
        """See `Recorder.start`."""
        # Imported late: it loads numba.
        from fpid_pin.kernels import metrics

        self._kernels: Any = metrics
        self._step, self._applied, self._limit = batch.step, batch.rows - 1, batch.limit
        self._sums = np.zeros((batch.runs, batch.n), metrics.SUM)
        self._traces = np.zeros((batch.runs, batch.n), metrics.TRACE)

    def take(self, block: Block) -> None:
        """See `Recorder.take`."""
        error = np.ascontiguousarray(block.q_ref - block.q)
        torque, valid, first, applied = block.torque, block.valid, block.first, self._applied
        self._kernels.tally(
            self._sums, error, torque, valid, first, applied, applied // 2, self._step
        )
        self._kernels.trace(
            self._traces, error, torque, valid, self._limit, self._band, first, applied
        )

    def result(self) -> list[Metrics]:
        """Return the metrics of every run."""
        h, sums, path = self._step, self._sums, self._traces
        stayed = (path["rows"] == self._applied) & (path["settled"] < path["rows"])
        with np.errstate(divide="ignore", invalid="ignore"):
            table = {
                "ise": h * sums["square"],
                "iae": h * sums["absolute"],
                "itae": h * sums["aged"],
                "rms": np.sqrt(sums["square"] / sums["rows"]),
                "rms_tail": np.sqrt(sums["late"] / sums["late_rows"]),
                "energy": h * sums["effort"],
                "total_variation": sums["changes"].copy(),
                "peak_torque": sums["peak"].copy(),
                "peak_error": path["worst"].copy(),
                "settling_time": np.where(stayed, h * path["settled"], np.inf),
                "overshoot": np.where(np.abs(path["start"]) > self._band, path["beyond"], 0.0),
                "saturated": np.where(
                    np.isnan(self._limit), np.nan, path["at_limit"] / path["rows"]
                ),
                "torque_rate": np.sqrt(path["jumps"] / (path["rows"] - 1)) / h,
            }
        return [
            Metrics(**{name: values[run] for name, values in table.items()})
            for run in range(len(sums))
        ]


def metrics_of(run: Run, band: float = SETTLING_BAND) -> Metrics:
    """Return the metrics of a recorded run: the same bits as while it ran.

    Parameters
    ----------
    run
        Of any origin.
    band
        Within which the error counts as settled [rad].
    """
    recorder = MetricsRecorder(band)
    recorder.start(_batch(run))
    for block in _blocks(run):
        recorder.take(block)
    return recorder.result()[0]


def cost_of(run: Run, cost: Cost) -> float:
    """Return the cost of a recorded run, the bits that `evaluate` gives; +inf where it diverged."""
    if not run.outcome.completed:
        return float("inf")
    streamed = cost.streamed()
    if streamed is None:
        return cost.of(run.metrics)
    recorder = RowCosts([streamed])
    recorder.start(_batch(run, with_arm=True))
    for block in _blocks(run):
        recorder.take(block)
    return recorder.result(0, 0)


def _batch(run: Run, with_arm: bool = False) -> Batch:
    n = run.q.shape[1]
    # A file from before it was written down does not say.
    limit = np.array([run.meta.get("effort_limit", [np.nan] * n)])
    return Batch(1, n, run.planned_rows, run.step, limit, run.arm if with_arm else None)


def _blocks(run: Run) -> Iterator[Block]:
    """Yield the rows of a run in the portions in which they came."""
    names = ("q_ref", "v_ref", "q", "v", "torque")
    for first in range(0, len(run.t), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        part = {
            name: np.ascontiguousarray(getattr(run, name)[rows])[:, np.newaxis] for name in names
        }
        signals = {name: array[rows][:, np.newaxis] for name, array in run.signals.items()}
        t = run.t[rows]
        yield Block(first, t, **part, valid=np.array([len(t)]), signals=signals)
