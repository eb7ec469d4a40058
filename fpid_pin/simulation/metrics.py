"""Figures of merit, per joint: the same sums for a recorded run and for rows that stream by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.costs import Metrics
from fpid_pin.simulation.recorders import BLOCK_ROWS, Batch, Block

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run


class MetricsRecorder:
    """Accumulates the sums behind `Metrics`; its memory does not depend on the horizon."""

    wanted: Sequence[str] = ()

    def start(self, batch: Batch) -> None:
        """See `Recorder.start`."""
        # Imported late: it loads numba.
        from fpid_pin.kernels.metrics import SUM, tally

        self._tally: Any = tally
        self._step, self._applied = batch.step, batch.rows - 1
        self._sums = np.zeros((batch.runs, batch.n), SUM)

    def take(self, block: Block) -> None:
        """See `Recorder.take`."""
        error = np.ascontiguousarray(block.q_ref - block.q)
        half = self._applied // 2
        self._tally(
            self._sums, error, block.torque, block.valid, block.first, self._applied, half,
            self._step,
        )  # fmt: skip

    def result(self) -> list[Metrics]:
        """Return the metrics of every run."""
        h, sums = self._step, self._sums
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
            }
        return [
            Metrics(**{name: values[run] for name, values in table.items()})
            for run in range(len(sums))
        ]


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
