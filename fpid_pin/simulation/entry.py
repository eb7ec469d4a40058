"""`simulate` and `evaluate`: the ways into the engine, for one robot or thousands."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from typing import overload

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.resources import require_memory
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.workers import WorkerPool, check_workers, spread, workers_of

#: Numbers in a row of a record, for each joint: motion, torque, and six signals of a law.
_NUMBERS = 11
#: Runs that are started together, and of a part that is dealt out to an executor.
PART = 64


def _pairs(
    experiments: Experiment | Sequence[Experiment], controllers: Controller | Sequence[Controller]
) -> tuple[list[Experiment], list[Controller]]:
    """Broadcast experiments and controllers against each other: equal lengths, or one is single."""
    if isinstance(experiments, Controller) and not isinstance(controllers, Controller):
        raise ArgumentError("experiment", "the experiment first, then the controller", "a law")
    left = [experiments] if isinstance(experiments, Experiment) else list(experiments)
    right = [controllers] if isinstance(controllers, Controller) else list(controllers)
    for e in left:
        checks.instance("experiment", e, Experiment, "an Experiment")
    for c in right:
        checks.instance("controller", c, Controller, "a Controller")
    runs = max(len(left), len(right))
    if not left or not right or not {len(left), len(right)} <= {1, runs}:
        raise ArgumentError(
            "experiments and controllers", "equal numbers, or one of either",
            f"{len(left)} and {len(right)}",
        )  # fmt: skip
    return left * (runs // len(left)), right * (runs // len(right))


@overload
def simulate(
    experiment: Experiment, controller: Controller, *, progress: ProgressCallback | None = None
) -> Run: ...
@overload
def simulate(
    experiment: Sequence[Experiment],
    controller: Controller | Sequence[Controller],
    *,
    progress: ProgressCallback | None = None,
) -> list[Run]: ...
@overload
def simulate(
    experiment: Experiment,
    controller: Sequence[Controller],
    *,
    progress: ProgressCallback | None = None,
) -> list[Run]: ...


def simulate(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller | Sequence[Controller],
    *,
    progress: ProgressCallback | None = None,
) -> Run | list[Run]:
    """Simulate and record everything.

    Parameters
    ----------
    experiment, controller
        One of each gives a `Run`; sequences give a list of runs, a single one serving all.
    progress
        Called now and then with a `Progress`.

    Returns
    -------
    Run or list of Run
        A diverged run is cut where it ended; ``run.outcome`` says why.

    Raises
    ------
    ArgumentError, SimulationError
        Before anything is simulated.

    Warns
    -----
    FpidWarning
        A joint whose effort limit is lower than gravity at the start pose.
    """
    experiments, controllers = _pairs(experiment, controller)
    size = sum(e.rows * (1 + _NUMBERS * e.arm.n) * 8.0 for e in experiments)
    what = f"{len(experiments)} runs" if len(experiments) > 1 else "a run"
    longest = max(e.rows for e in experiments)
    require_memory("duration", f"{what} of {longest:.3g} rows", size)
    distinct = {id(e): e for e in experiments}.values()
    # A limit that was given to the plant by hand is taken to be meant.
    lines = [line for e in distinct for line in e.joints_that_fall(by_hand=False)]
    for line in dict.fromkeys(lines):
        warnings.warn(line, FpidWarning, stacklevel=2)
    # Imported late: it loads numba.
    from fpid_pin.simulation.batch import record_runs

    runs = record_runs(experiments, controllers, progress)
    single = isinstance(experiment, Experiment) and isinstance(controller, Controller)
    return runs[0] if single else runs


def evaluate(
    experiments: Experiment | Sequence[Experiment],
    controllers: Controller | Sequence[Controller],
    cost: Cost | Sequence[Cost] | None = None,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    progress: ProgressCallback | None = None,
) -> FloatArray:
    """Simulate and keep only the cost; memory does not depend on the horizon.

    Parameters
    ----------
    experiments, controllers
        As for `simulate`.
    cost
        One cost gives (runs,), a sequence gives (runs, costs); None: eq. (33).
    executor
        Any `concurrent.futures.Executor`; the runs are dealt out to it, at most 64 a task. The
        result is the same to the last bit.
    workers
        In place of an executor: threads for compiled laws and dynamics, else processes.
    progress
        As for `simulate`.

    Returns
    -------
    ndarray
        +inf where a run diverged.

    Raises
    ------
    WorkersDied
        Workers of the executor died twice over the same runs.
    """
    # Imported late: it loads numba.
    from fpid_pin.simulation.batch import costs_of

    es, cs = _pairs(experiments, controllers)
    costs: list[Cost] = (
        [QuadraticCost()] if cost is None else [cost] if isinstance(cost, Cost) else list(cost)
    )
    table, done = np.empty((len(es), len(costs))), 0

    def tell(rows: float) -> None:
        if progress is not None:
            progress(Progress(rows / len(es)))

    with executor_of(executor, workers, es, cs) as pool:
        if pool is not None:
            warm(es, cs)
        # Small parts: progress is told, and Ctrl-C obeyed, after each.
        size = -(-len(es) // max(workers_of(pool), -(-len(es) // PART)))
        cuts = [slice(first, first + size) for first in range(0, len(es), size)]

        def inside(part: Progress) -> None:
            tell(done + part.part * min(size, len(es) - done))

        tasks = [(es[cut], cs[cut], costs, None if pool else inside) for cut in cuts]
        for k, rows in spread(costs_of, tasks, pool):
            table[cuts[k]] = rows
            done += len(rows)
            if pool is not None:
                tell(done)
    return table[:, 0] if cost is None or isinstance(cost, Cost) else table


def executor_of(
    executor: Executor | None,
    workers: int | None,
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
) -> AbstractContextManager[Executor | None]:
    """Return the caller's executor, which stays open, or workers of our own, which are closed.

    Compiled work lets go of the interpreter's lock, so that threads share it out; a law in Python,
    or Pinocchio's dynamics, needs processes.
    """
    check_workers(executor, workers)
    if executor is not None or workers is None:
        return nullcontext(executor)
    holds = any(c.control is not None for c in controllers)
    holds = holds or any(e.dynamics == "pinocchio" for e in experiments)
    return WorkerPool(workers) if holds else ThreadPoolExecutor(workers)


def warm(experiments: Sequence[Experiment], controllers: Sequence[Controller]) -> None:
    """Run two ticks of each kind of law, so that workers find all kernels compiled."""
    from fpid_pin.simulation.batch import costs_of

    kinds = {(type(c), e.arm.n): (e, c) for e, c in zip(experiments, controllers, strict=True)}
    for e, c in kinds.values():
        short = dataclasses.replace(e, duration=2.0 * e.step)
        costs_of([short], [c], [QuadraticCost()])
