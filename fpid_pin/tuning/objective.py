"""What a search makes small: candidates in, costs out, one call for all of them."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from concurrent.futures import Executor

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.exceptions import FpidWarning, WorkersDied
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment, evaluate, simulate
from fpid_pin.tuning.robust import over_scenarios
from fpid_pin.tuning.space import BoundSpace


class Objective:
    """Costs of points of a space.

    Parameters
    ----------
    experiments
        Each candidate goes through all of them.
    space
        With its controller.
    costs
        One column each.
    executor
        Shares out the runs; None: in this process. One whose workers die twice over the same runs
        is left alone from then on, with a warning, and the work goes on in this process: the
        results are the same.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        space: BoundSpace,
        costs: Sequence[Cost],
        executor: Executor | None = None,
    ) -> None:
        self._experiments, self._space, self._costs = list(experiments), space, list(costs)
        self._executor = executor

    @property
    def runs(self) -> int:
        """Runs that each candidate takes."""
        return len(self._experiments)

    def __call__(self, points: FloatArray, progress: ProgressCallback | None = None) -> FloatArray:
        """Return costs (candidates, costs) at points of the unit cube, (candidates, size).

        +inf where a run diverged.
        """
        return self.of([self._space.controller(point) for point in points], progress)

    def of(
        self, controllers: Sequence[Controller], progress: ProgressCallback | None = None
    ) -> FloatArray:
        """Return the costs of controllers, (controllers, costs)."""
        scenarios, count = len(self._experiments), len(controllers)
        # Scenario by scenario: what neighbouring runs are given from outside is sampled once.
        experiments = [e for e in self._experiments for _ in range(count)]
        runs = list(controllers) * scenarios
        try:
            table = evaluate(
                experiments, runs, self._costs, executor=self._executor, progress=progress
            )
        except WorkersDied as error:
            warnings.warn(
                f"{error}; going on in this process, with the same results",
                FpidWarning,
                stacklevel=2,
            )
            self._executor = None
            table = evaluate(experiments, runs, self._costs, progress=progress)
        shaped = table.reshape(scenarios, count, len(self._costs))
        columns = [
            over_scenarios(cost, np.ascontiguousarray(shaped[:, :, k]))
            for k, cost in enumerate(self._costs)
        ]
        return np.stack(columns, axis=1)

    def cause(self, point: FloatArray) -> str:
        """Simulate one candidate that diverged and say how."""
        controller = self._space.controller(point)
        for experiment in self._experiments:
            outcome = simulate(experiment, controller).outcome
            if not outcome.completed:
                return str(outcome)
        return "its cost is not finite"
