"""Figures of merit, per joint: the same sums for a recorded run and for rows that stream by."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import fields
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.costs import Metrics
from fpid_pin.simulation.recorders import BLOCK_ROWS, Batch, Block, total, void

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run

_SUMS = ("square", "late", "size", "aged", "effort", "changes")


class MetricsRecorder:
    """Accumulates the sums behind `Metrics`; its memory does not depend on the horizon.

    Parameters
    ----------
    only
        Names of the metrics that are wanted; the others come out as NaN and cost nothing. None:
        all of them.
    """

    wanted: Sequence[str] = ()

    def __init__(self, only: Collection[str] | None = None) -> None:
        names = [field.name for field in fields(Metrics)]
        self._only = frozenset(names if only is None else only)

    def start(self, batch: Batch) -> None:
        """See `Recorder.start`."""
        self._step = batch.step
        self._applied = batch.rows - 1
        self._half = self._applied // 2
        self._counts = np.zeros(batch.runs)
        self._tail_counts = np.zeros(batch.runs)
        self._shape = (batch.runs, batch.n)
        self._sums: dict[str, FloatArray] = {}
        self._peak = np.zeros(self._shape)
        self._last_torque: FloatArray | None = None

    def _add(self, name: str, rows: FloatArray) -> None:
        if name not in self._sums:
            self._sums[name] = np.zeros(self._shape)
        self._sums[name] += total(rows)

    def take(self, block: Block) -> None:
        """See `Recorder.take`."""
        if not len(block.t):
            return
        k, stop, only = len(block.t), self._applied, self._only
        error = void(block.q_ref - block.q, block, stop)
        if only & {"ise", "rms", "rms_tail"}:
            square = error * error
            self._add("square", square)
            late = np.arange(block.first, block.first + k) >= self._half
            if late.any():
                self._add("late", square[late])
        if only & {"iae", "itae"}:
            size = np.abs(error, out=error)
            self._add("size", size)
            self._add("aged", block.t[:, np.newaxis, np.newaxis] * size)
        if only & {"energy", "peak_torque"}:
            torque = void(block.torque.copy(), block, stop)
            np.maximum(self._peak, np.abs(torque).max(axis=0), out=self._peak)
            torque *= torque
            self._add("effort", torque)
        if "total_variation" in only:
            before = block.torque[:1] if self._last_torque is None else self._last_torque
            changes = np.abs(np.diff(block.torque, axis=0, prepend=before))
            self._add("changes", void(changes, block, stop))
            self._last_torque = block.torque[-1:].copy()
        rows = np.clip(np.minimum(block.valid, stop - block.first), 0, k)
        self._counts += rows
        self._tail_counts += np.clip(block.first + rows - max(self._half, block.first), 0, k)

    def result(self) -> list[Metrics]:
        """Return the metrics of every run."""
        h, nothing = self._step, np.full(self._shape, np.nan)
        sums = {name: self._sums.get(name, nothing) for name in _SUMS}
        counts, late = self._counts[:, np.newaxis], self._tail_counts[:, np.newaxis]
        with np.errstate(divide="ignore", invalid="ignore"):
            table = {
                "ise": h * sums["square"],
                "iae": h * sums["size"],
                "itae": h * sums["aged"],
                "rms": np.sqrt(sums["square"] / counts),
                "rms_tail": np.sqrt(sums["late"] / late),
                "energy": h * sums["effort"],
                "total_variation": sums["changes"],
                "peak_torque": self._peak,
            }
        for name in table:
            if name not in self._only:
                table[name] = nothing
        runs = range(self._shape[0])
        return [Metrics(**{name: values[run] for name, values in table.items()}) for run in runs]


def metrics_of(run: Run) -> Metrics:
    """Return the metrics of a recorded run: the same bits as while it ran."""
    recorder = MetricsRecorder()
    n = run.q.shape[1]
    recorder.start(Batch(runs=1, n=n, rows=run.planned_rows, step=run.step))
    for first in range(0, len(run.t), BLOCK_ROWS):
        rows = slice(first, first + BLOCK_ROWS)
        t = run.t[rows]
        q_ref, v_ref, q, v, torque = (
            np.ascontiguousarray(array[rows])[:, np.newaxis]
            for array in (run.q_ref, run.v_ref, run.q, run.v, run.torque)
        )
        recorder.take(Block(first, t, q_ref, v_ref, q, v, torque, np.array([len(t)])))
    return recorder.result()[0]
