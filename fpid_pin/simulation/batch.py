"""Many robots under the engine: one chunk of work, wherever it is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.state import start_all
from fpid_pin.costs import Cost, Metrics, Rows
from fpid_pin.costs.cost import BLOCK_ROWS, MOTION, RowCosts
from fpid_pin.costs.metrics import metrics_from
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.engine import Block, Robot, horizon_of
from fpid_pin.simulation.experiment import Experiment, Outcome
from fpid_pin.simulation.recorded import describe_run
from fpid_pin.simulation.run import Run


def start_robots(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    *,
    dynamics: str,
    keep: Sequence[str] | None = (),
    measures: bool = False,
) -> list[Robot]:
    """Start a robot for each pair; their laws' operators are fitted together.

    `dynamics` are those of experiments that do not say; `keep` names the signals to record, None
    being all that the law shows; `measures` tells whether figures of merit are wanted.
    """
    groups: dict[Any, list[int]] = {}
    for i, e in enumerate(experiments):
        groups.setdefault((id(e.arm), e.step, horizon_of(e.duration)), []).append(i)
    states: dict[int, Any] = {}
    for (_, step, horizon), members in groups.items():
        arm, laws = experiments[members[0]].arm, [controllers[i] for i in members]
        states |= zip(members, start_all(laws, arm, step=step, horizon=horizon), strict=True)
    robots = []
    for i, e in enumerate(experiments):
        state = states[i]
        names = [*state.controller.shown, *state.shown] if keep is None else keep
        limit = e.torque_limit if measures else None
        robots.append(Robot(e, state, dynamics=e.dynamics or dynamics, keep=names, limit=limit))
    return robots


def advance_all(
    robots: Sequence[Robot],
    take: Callable[[int, Rows], None] | None = None,
    progress: ProgressCallback | None = None,
) -> list[Outcome]:
    """Take robots to their ends, a block of rows after another, and return how they ended.

    Each robot's rows, views of arrays that are used again, go to `take` with its number.
    """
    longest = max(robot.experiment.rows for robot in robots)
    with np.errstate(all="ignore"):
        for first in range(0, longest, BLOCK_ROWS):
            blocks: dict[Any, Block] = {}
            for i, robot in enumerate(robots):
                e, signals = robot.experiment, len(robot.keep)
                count = min(BLOCK_ROWS, e.rows - first)
                if robot.outcome is not None or count <= 0:
                    continue
                key = (id(e), signals)
                if key not in blocks:
                    blocks[key] = Block(e, first, count, signals)
                rows = robot.advance(blocks[key])
                if take is not None:
                    take(i, rows)
            if progress is not None:
                progress(Progress(min(first + BLOCK_ROWS, longest) / longest))
    outcomes = []
    for robot in robots:
        e, end = robot.experiment, robot.outcome
        # A run may be lost by the step after its last row, which is no part of it.
        if end is None or round(end.time / e.step) >= e.rows:
            end = Outcome(completed=True, time=(e.rows - 1) * e.step)
        outcomes.append(end)
    return outcomes


def record_runs(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    progress: ProgressCallback | None,
) -> list[Run]:
    """Simulate runs and record everything: see `entry.simulate`."""
    robots = start_robots(experiments, controllers, dynamics="pinocchio", keep=None)
    records: list[dict[str, FloatArray]] = [{} for _ in robots]

    def take(i: int, rows: Rows) -> None:
        arrays = {name: getattr(rows, name) for name in MOTION} | dict(rows.signals)
        for name, values in arrays.items():
            if name not in records[i]:
                records[i][name] = np.zeros((experiments[i].rows, *values.shape[1:]))
            records[i][name][rows.first : rows.first + len(values)] = values

    runs = []
    for i, outcome in enumerate(advance_all(robots, take, progress)):
        e = experiments[i]
        rows = e.rows if outcome.completed else round(outcome.time / e.step)
        signals = {name: values[:rows] for name, values in records[i].items()}
        motion = {name: signals.pop(name) for name in MOTION}
        t = np.arange(rows, dtype=np.float64) * e.step
        meta = describe_run(e, controllers[i], e.dynamics or "pinocchio")
        runs.append(Run(t, **motion, signals=signals, outcome=outcome, step=e.step,
                        planned_rows=e.rows, meta=meta))  # fmt: skip
    return runs


def measure(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    take: Callable[[int, Rows], None] | None = None,
    keep: Sequence[str] = (),
    progress: ProgressCallback | None = None,
) -> list[tuple[Outcome, Metrics]]:
    """Simulate runs, whose rows and the signals `keep` go to `take`; return how they ended."""
    robots = start_robots(experiments, controllers, dynamics="compiled", keep=keep, measures=True)
    outcomes = advance_all(robots, take, progress)
    return [
        (outcome, metrics_from(robot.sums, e.rows - 1, e.step))
        for outcome, robot, e in zip(outcomes, robots, experiments, strict=True)
    ]


def costs_of(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    costs: Sequence[Cost],
    progress: ProgressCallback | None = None,
) -> FloatArray:
    """Return the costs of some runs, (runs, costs): one chunk of work, wherever it is done."""
    streams = [cost.streamed() for cost in costs]
    streamed = [stream for stream in streams if stream is not None]
    wanted = sorted({name for stream in streamed for name in stream.signals})
    sinks = [RowCosts(streamed, e.rows - 1) for e in experiments]

    def take(i: int, rows: Rows) -> None:
        sinks[i].take(rows)

    found = measure(experiments, controllers, take if streamed else None, wanted, progress)
    table = np.full((len(experiments), len(costs)), np.inf)
    for i, (outcome, metrics) in enumerate(found):
        if outcome.completed:
            others = iter(sinks[i].results())
            table[i] = [
                cost.of(metrics) if stream is None else next(others)
                for cost, stream in zip(costs, streams, strict=True)
            ]
    return table
