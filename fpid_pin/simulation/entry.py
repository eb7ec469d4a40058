"""`simulate` and `evaluate`: the ways into the engine, for one robot or thousands."""

from __future__ import annotations

import dataclasses
import warnings
from collections.abc import Sequence
from concurrent.futures import Executor, Future
from typing import overload

import numpy as np

from fpid_pin.budget import require_memory
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.exceptions import FpidWarning
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import overloaded_joints
from fpid_pin.simulation.lockstep import apart_if_wrong, batches, lockstep, pair
from fpid_pin.simulation.metrics import MetricsRecorder
from fpid_pin.simulation.recorders import FullRecord, Outcome
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.run_meta import describe_run
from fpid_pin.simulation.streamed import RowCosts

# More runs in one call gain nothing: their states no longer fit the processor's cache.
MOST_RUNS = 240
#: Numbers in a row of a record, for each joint: motion, torque, and six signals of a law.
_NUMBERS = 11


def _overall(
    progress: ProgressCallback | None, done: int, size: int, runs: int
) -> ProgressCallback | None:
    if progress is None:
        return None
    return lambda inner: progress(Progress((done + inner.part * size) / runs))


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
    experiments, controllers = pair(experiment, controller)
    _require_room(experiments)
    distinct = {id(e): e for e in experiments}
    for line in dict.fromkeys(line for e in distinct.values() for line in overloaded_joints(e)):
        warnings.warn(line, FpidWarning, stacklevel=2)
    runs: list[Run | None] = [None] * len(experiments)
    done = 0

    def record(members: list[int]) -> None:
        recorder = FullRecord()
        es, cs = [experiments[i] for i in members], [controllers[i] for i in members]
        outcomes = lockstep(es, cs, [recorder], _overall(progress, done, len(members), len(runs)))
        for row, (i, outcome) in enumerate(zip(members, outcomes, strict=True)):
            runs[i] = _run(experiments[i], controllers[i], recorder, row, outcome)

    for members in batches(experiments, controllers, MOST_RUNS):
        apart_if_wrong(members, record)
        done += len(members)
    single = isinstance(experiment, Experiment) and isinstance(controller, Controller)
    finished = [run for run in runs if run is not None]
    return finished[0] if single else finished


def _require_room(experiments: Sequence[Experiment]) -> None:
    """Refuse a record that would not fit into memory."""
    size = sum(e.rows * (1 + _NUMBERS * e.arm.n) * 8.0 for e in experiments)
    longest = max(e.rows for e in experiments)
    what = f"{len(experiments)} runs" if len(experiments) > 1 else "a run"
    require_memory("duration", f"{what} of {longest:.3g} rows", size)


def _run(e: Experiment, c: Controller, record: FullRecord, row: int, outcome: Outcome) -> Run:
    """Make a run of its row of a record, cut where it ended."""
    rows = e.rows if outcome.completed else round(outcome.time / e.step)
    arrays = {name: values[row, :rows] for name, values in record.arrays.items()}
    named = {name: arrays.pop(name) for name in ("q", "v", "q_ref", "v_ref", "torque")}
    t = np.arange(rows, dtype=np.float64) * e.step
    return Run(
        t, **named, signals=arrays, outcome=outcome, step=e.step,
        planned_rows=e.rows, meta=describe_run(e, c, getattr(c, "name", "")),
    )  # fmt: skip


def evaluate(
    experiments: Experiment | Sequence[Experiment],
    controllers: Controller | Sequence[Controller],
    cost: Cost | Sequence[Cost] | None = None,
    *,
    executor: Executor | None = None,
    shards: int | None = None,
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
        Any `concurrent.futures.Executor` of processes; the runs are dealt out to it. The result
        is the same to the last bit.
    shards
        Number of parts for the executor; None: its number of workers where it tells, else 2.
    progress
        As for `simulate`.

    Returns
    -------
    ndarray
        +inf where a run diverged.
    """
    es, cs = pair(experiments, controllers)
    costs = [QuadraticCost()] if cost is None else [cost] if isinstance(cost, Cost) else list(cost)
    if executor is None:
        table = _evaluate(es, cs, costs, progress)
    else:
        warm(es, cs)
        parts = shards or int(getattr(executor, "_max_workers", 2))
        cuts = np.array_split(np.arange(len(es)), min(parts, len(es)))
        futures: list[Future[FloatArray]] = [
            executor.submit(_evaluate, [es[i] for i in cut], [cs[i] for i in cut], costs, None)
            for cut in cuts
        ]
        pieces = []
        for number, future in enumerate(futures, start=1):
            pieces.append(future.result())
            if progress is not None:
                progress(Progress(number / len(futures)))
        table = np.concatenate(pieces)
    return table[:, 0] if cost is None or isinstance(cost, Cost) else table


def warm(experiments: Sequence[Experiment], controllers: Sequence[Controller]) -> None:
    """Run two ticks of each kind of run, so that worker processes find all kernels compiled."""
    for members in batches(experiments, controllers, len(experiments)):
        first = members[0]
        short = dataclasses.replace(experiments[first], duration=2.0 * experiments[first].step)
        _evaluate([short], [controllers[first]], [QuadraticCost()], None)


def _evaluate(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    costs: Sequence[Cost],
    progress: ProgressCallback | None,
) -> FloatArray:
    table = np.full((len(experiments), len(costs)), np.inf)
    streams = {k: s for k, cost in enumerate(costs) if (s := cost.streamed()) is not None}
    done = 0

    def judge(members: list[int]) -> None:
        metrics, rows = MetricsRecorder(), RowCosts(list(streams.values()))
        outcomes = lockstep(
            [experiments[i] for i in members],
            [controllers[i] for i in members],
            [metrics, rows] if streams else [metrics],
            _overall(progress, done, len(members), len(experiments)),
        )
        for run, (i, found) in enumerate(zip(members, metrics.result(), strict=True)):
            if outcomes[run].completed:
                table[i] = [
                    rows.result(run, list(streams).index(k)) if k in streams else cost.of(found)
                    for k, cost in enumerate(costs)
                ]

    for members in batches(experiments, controllers, MOST_RUNS):
        apart_if_wrong(members, judge)
        done += len(members)
    return table
