"""Many robots under the engine: one chunk of work, wherever it is done."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.start import start_all
from fpid_pin.costs import Cost
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.blocks import BLOCK_ROWS, Block, Outcome
from fpid_pin.simulation.engine import Robot, Samples, horizon_of
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import torque_limit
from fpid_pin.simulation.metrics import RowCosts, metrics_from
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.run_meta import describe_run

#: Robots that are started together: their operators are fitted at once.
MOST_RUNS = 240


def start_robots(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    *,
    dynamics: str,
    keep: Sequence[str] | None = (),
    measures: bool = False,
) -> list[Robot]:
    """Start a robot for each pair; their laws' operators are fitted together.

    Parameters
    ----------
    experiments, controllers
        One a robot.
    dynamics
        Of experiments that do not say.
    keep
        Signals that blocks hold; None: all that the law shows.
    measures
        Whether figures of merit are wanted.
    """
    groups: dict[Any, list[int]] = {}
    for i, e in enumerate(experiments):
        groups.setdefault((id(e.arm), e.step, horizon_of(e.duration)), []).append(i)
    states: dict[int, Any] = {}
    for (_, step, horizon), members in groups.items():
        arm = experiments[members[0]].arm
        laws = [controllers[i] for i in members]
        states |= zip(members, start_all(laws, arm, step=step, horizon=horizon), strict=True)
    limits = {id(e): torque_limit(e) for e in experiments} if measures else {}
    robots = []
    for i, e in enumerate(experiments):
        state = states[i]
        names = [*state.shown_names(), *state.shown] if keep is None else keep
        robots.append(
            Robot(e, state, dynamics=e.dynamics or dynamics, keep=names, limit=limits.get(id(e)))
        )
    return robots


def advance_all(
    robots: Sequence[Robot],
    take: Callable[[int, Block], None] | None = None,
    progress: ProgressCallback | None = None,
) -> list[Outcome]:
    """Take robots to their ends, a block of rows after another, and return how they ended.

    What experiments are given from outside is sampled once for all robots of one experiment.
    """
    rows = [robot.experiment.rows for robot in robots]
    buffers: dict[Any, Any] = {}
    with np.errstate(all="ignore"):
        for first in range(0, max(rows), BLOCK_ROWS):
            samples: dict[int, Samples] = {}
            for i, robot in enumerate(robots):
                count = min(BLOCK_ROWS, rows[i] - first)
                if robot.outcome is not None or count <= 0:
                    continue
                e = robot.experiment
                if id(e) not in samples:
                    samples[id(e)] = Samples(e, robot.plant, first, count)
                key = (len(robot.q), len(robot._keep))
                if key not in buffers:
                    buffers[key] = robot.buffer()
                block = robot.advance(samples[id(e)], buffers[key], count)
                if take is not None:
                    take(i, block)
            if progress is not None:
                progress(Progress(min(first + BLOCK_ROWS, max(rows)) / max(rows)))
    ends = []
    for robot in robots:
        e, end = robot.experiment, robot.outcome
        done = Outcome(completed=True, time=(e.rows - 1) * e.step)
        # A run may be lost by the step after its last row, which is no part of it.
        ends.append(end if end is not None and round(end.time / e.step) < e.rows else done)
    return ends


def _overall(
    progress: ProgressCallback | None, done: int, size: int, runs: int
) -> ProgressCallback | None:
    if progress is None:
        return None
    return lambda inner: progress(Progress((done + inner.part * size) / runs))


def _taker(sinks: Sequence[Any]) -> Callable[[int, Block], None]:
    """Return what hands each robot's blocks on to a sink of its own."""
    return lambda i, block: sinks[i].take(block)


def record_runs(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    progress: ProgressCallback | None,
) -> list[Run]:
    """Simulate runs and record everything: see `entry.simulate`."""
    runs: list[Run] = []
    for start in range(0, len(experiments), MOST_RUNS):
        es, cs = experiments[start : start + MOST_RUNS], controllers[start : start + MOST_RUNS]
        robots = start_robots(es, cs, dynamics="pinocchio", keep=None)
        records = [_Record(robot) for robot in robots]
        inner = _overall(progress, start, len(es), len(experiments))
        outcomes = advance_all(robots, _taker(records), inner)
        runs += [
            record.run(c, outcome) for record, c, outcome in zip(records, cs, outcomes, strict=True)
        ]
    return runs


class _Record:
    """Every row of every signal of a robot: what a `Run` is made of."""

    def __init__(self, robot: Robot) -> None:
        self._robot, self._arrays = robot, dict[str, FloatArray]()

    def take(self, block: Block) -> None:
        """Copy the rows of a block."""
        names = ("q", "v", "q_ref", "v_ref", "torque")
        rows = {name: getattr(block, name) for name in names} | block.signals
        for name, values in rows.items():
            if name not in self._arrays:
                shape = (self._robot.experiment.rows, *values.shape[1:])
                self._arrays[name] = np.zeros(shape)
            self._arrays[name][block.first : block.first + len(values)] = values

    def run(self, controller: Controller, outcome: Outcome) -> Run:
        """Return the run, cut where it ended."""
        e = self._robot.experiment
        rows = e.rows if outcome.completed else round(outcome.time / e.step)
        arrays = {name: values[:rows] for name, values in self._arrays.items()}
        named = {name: arrays.pop(name) for name in ("q", "v", "q_ref", "v_ref", "torque")}
        t = np.arange(rows, dtype=np.float64) * e.step
        dynamics = e.dynamics or "pinocchio"
        return Run(
            t, **named, signals=arrays, outcome=outcome, step=e.step, planned_rows=e.rows,
            meta=describe_run(e, controller, getattr(controller, "name", ""), dynamics),
        )  # fmt: skip


def costs_of(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    costs: Sequence[Cost],
    progress: ProgressCallback | None,
) -> FloatArray:
    """Return the costs of some runs, (runs, costs): one chunk of work, wherever it is done."""
    table = np.full((len(experiments), len(costs)), np.inf)
    streams = [cost.streamed() for cost in costs]
    streamed = [stream for stream in streams if stream is not None]
    wanted = sorted({name for stream in streamed for name in stream.signals})
    for start in range(0, len(experiments), MOST_RUNS):
        es, cs = experiments[start : start + MOST_RUNS], controllers[start : start + MOST_RUNS]
        robots = start_robots(es, cs, dynamics="compiled", keep=wanted, measures=True)
        rows = [
            RowCosts(streamed, e.rows - 1, e.step, np.asarray(robot.sums["limit"]), e.arm)
            for e, robot in zip(es, robots, strict=True)
        ]
        inner = _overall(progress, start, len(es), len(experiments))
        take = _taker(rows) if streamed else None
        for i, outcome in enumerate(advance_all(robots, take, inner)):
            if not outcome.completed:
                continue
            e, others = es[i], iter(rows[i].results())
            found = metrics_from(robots[i].sums, e.rows - 1, e.step)
            table[start + i] = [
                cost.of(found) if stream is None else next(others)
                for cost, stream in zip(costs, streams, strict=True)
            ]
    return table
