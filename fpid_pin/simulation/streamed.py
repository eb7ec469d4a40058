"""Costs of a run's rows, while they stream by."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.costs import RowCost, Rows
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.recorders import Batch, Block


class RowCosts:
    """Hands each run's rows to costs; keeps nothing but what these remember.

    Parameters
    ----------
    costs
        Any number of them.
    """

    def __init__(self, costs: Sequence[RowCost]) -> None:
        self._costs = list(costs)
        self.wanted: Sequence[str] = sorted({name for cost in costs for name in cost.signals})

    def start(self, batch: Batch) -> None:
        """See `Recorder.start`."""
        self._batch = batch
        self._states: list[list[Any]] = [
            [cost.begin() for cost in self._costs] for _ in range(batch.runs)
        ]

    def take(self, block: Block) -> None:
        """See `Recorder.take`."""
        missing = [name for name in self.wanted if name not in block.signals]
        if missing:
            has = ", ".join(sorted(block.signals)) or "none"
            raise ArgumentError("cost.signals", f"signals of the law ({has})", missing[0])
        for run, states in enumerate(self._states):
            count = self._batch.applied(block, run)
            if count:
                rows = self._rows(block, run, count)
                for k, cost in enumerate(self._costs):
                    states[k] = cost.add(states[k], rows)

    def _rows(self, block: Block, run: int, count: int) -> Rows:
        # Copies of one layout: a sum's last bits must not depend on who runs beside.
        own = {
            name: np.ascontiguousarray(getattr(block, name)[:count, run])
            for name in ("q", "v", "q_ref", "v_ref", "torque")
        }
        signals = {
            name: np.ascontiguousarray(block.signals[name][:count, run]) for name in self.wanted
        }
        batch = self._batch
        return Rows(
            block.first, batch.step, block.t[:count].copy(), **own, signals=signals,
            limit=batch.limit[run], arm=batch.arm,
        )  # fmt: skip

    def result(self, run: int, cost: int) -> float:
        """Return what a run costs.

        Raises
        ------
        ArgumentError
            A cost that is no number.
        """
        value = self._costs[cost].finish(self._states[run][cost])
        try:
            return float(value)
        except (TypeError, ValueError):
            raise ArgumentError("cost", "a number", type(value).__name__) from None
