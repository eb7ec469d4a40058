"""What each parameter of a tuned controller is worth: the cost along it, all others held."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost
from fpid_pin.progress import ProgressCallback
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.entry import executor_of
from fpid_pin.tuning.objective import Objective
from fpid_pin.tuning.problem import one_cost, problem_of
from fpid_pin.tuning.space import Space

#: Part of a parameter's range by which it is moved to see whether it matters.
NUDGE = 0.1


@dataclass(frozen=True, eq=False)
class Profile:
    """Costs along each parameter in turn.

    Attributes
    ----------
    labels
        Of the parameters, as in `History`.
    values, costs
        (parameters, K); +inf where the run diverges.
    nudged
        (parameters, 2): the cost with the parameter a tenth of its range lower and higher, or at
        its bound where that is nearer.
    cost
        The controller's own.
    """

    labels: tuple[str, ...]
    values: FloatArray
    costs: FloatArray
    nudged: FloatArray
    cost: float

    @property
    def rises(self) -> FloatArray:
        """By what part of the cost it rises when a parameter moves a tenth of its range, at most.

        (parameters,); about 0: the parameter could be left out of the search.
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(self.nudged.max(axis=1) / self.cost - 1.0)


def profile(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller,
    space: Space,
    cost: Cost | None = None,
    *,
    points: int = 9,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> Profile:
    """Move each parameter of a controller over its range, the others held.

    Parameters
    ----------
    experiment, cost
        See `tune`.
    controller
        Inside of `space`, as one that `tune` has found.
    space
        The parameters, with their ranges.
    points
        Values of each.
    executor, workers
        See `SearchSettings`.
    progress
        Called with a `Progress` now and then.

    Raises
    ------
    ArgumentError
        A controller outside of the space.
    """
    count = checks.integer("points", points, low=2)
    costs = one_cost(cost)
    experiments, bound = problem_of(experiment, controller, space, costs)
    own = bound.point(controller, experiments[0].arm.n)
    line = np.concatenate([np.linspace(0.0, 1.0, count), [0.0, 0.0]])
    candidates = np.repeat(own[np.newaxis], bound.size * (count + 2), axis=0)
    for k in range(bound.size):
        line[count:] = max(own[k] - NUDGE, 0.0), min(own[k] + NUDGE, 1.0)
        candidates[k * (count + 2) : (k + 1) * (count + 2), k] = line
    with executor_of(executor, workers, experiments, [controller]) as pool:
        objective = Objective(experiments, bound, costs, pool)
        found = objective(candidates, progress)[:, 0].reshape(bound.size, count + 2)
        here = float(objective.of([controller])[0, 0])
    values = bound.values(candidates).reshape(bound.size, count + 2, bound.size)
    along = np.stack([values[k, :count, k] for k in range(bound.size)])
    return Profile(bound.labels, along, found[:, :count], found[:, count:], here)
