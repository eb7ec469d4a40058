"""`simulate` and `evaluate`: the ways into the engine, for one robot or thousands."""

import dataclasses
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from typing import TYPE_CHECKING, Any, overload

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control.law import Controller
from fpid_pin.costs import BLOCK_ROWS, MOTION, Cost, Metrics, QuadraticCost, RowCost, Rows
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.resources import require_memory
from fpid_pin.simulation.experiment import Experiment, Outcome, default_cost
from fpid_pin.simulation.recorded import SIGNAL, asks_degrees, describe_run, metrics_from
from fpid_pin.simulation.run import Run
from fpid_pin.simulation.workers import distribute, executor_of, workers_of

if TYPE_CHECKING:
    from fpid_pin.simulation.engine import Robot

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
    left = checks.several("experiment", experiments, Experiment, "an Experiment")
    right = checks.several("controller", controllers, Controller, "a Controller")
    runs = max(len(left), len(right))
    if not left or not right or not {len(left), len(right)} <= {1, runs}:
        raise ArgumentError(
            "experiments and controllers", "equal numbers, or one of either",
            f"{len(left)} and {len(right)}",
        )  # fmt: skip
    return left * (runs // len(left)), right * (runs // len(right))


@overload
def simulate(  # type: ignore[overload-overlap]
    experiment: Experiment, controller: Controller, *, progress: ProgressCallback | None = None
) -> Run: ...
@overload
def simulate(
    experiment: Experiment | Sequence[Experiment],
    controller: Controller | Sequence[Controller],
    *,
    progress: ProgressCallback | None = None,
) -> list[Run]: ...


@checked
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
        A joint whose effort limit is lower than gravity at the start pose; angles that seem to be
        in degrees, beyond a turn or five times the joint's limits.
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
        warnings.warn(line, FpidWarning, stacklevel=3)
    runs = _record(experiments, controllers, progress)
    asked = (asks_degrees(e.arm, run) for e, run in zip(experiments, runs, strict=True))
    if line := next(filter(None, asked), ""):
        warnings.warn(line, FpidWarning, stacklevel=3)
    single = isinstance(experiment, Experiment) and isinstance(controller, Controller)
    return runs[0] if single else runs


def _record(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    progress: ProgressCallback | None,
) -> list[Run]:
    robots = start_robots(experiments, controllers)
    records: list[dict[str, FloatArray]] = [{} for _ in robots]

    def take(i: int, rows: Rows) -> None:
        arrays = {name: getattr(rows, name) for name in MOTION}
        arrays |= {f"{SIGNAL}{name}": values for name, values in rows.signals.items()}
        for name, values in arrays.items():
            if name not in records[i]:
                records[i][name] = np.zeros((experiments[i].rows, *values.shape[1:]))
            records[i][name][rows.first : rows.first + len(values)] = values

    runs = []
    for i, outcome in enumerate(advance_all(robots, take, progress)):
        e = experiments[i]
        rows = e.rows if outcome.completed else round(outcome.time / e.step)
        arrays = {"t": np.arange(rows, dtype=np.float64) * e.step}
        arrays |= {name: values[:rows] for name, values in records[i].items()}
        meta = describe_run(e, controllers[i], e.dynamics or "pinocchio")
        about = {"step": e.step, "planned_rows": e.rows, "meta": meta}
        runs.append(Run._of(arrays, outcome=outcome, **about))
    return runs


@checked
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
        One cost gives (runs,), a sequence gives (runs, costs); None: eq. (33) on the paper's arm,
        on others `TrackingCost`, the worst joint's RMS error over the last half.
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
    ArgumentError, SimulationError
        As for `simulate`; a cost that is no number.
    WorkersDied
        Workers of the executor died twice over the same runs.
    """
    es, cs = _pairs(experiments, controllers)
    if cost is None:
        cost = default_cost(e.arm for e in es)
    costs = checks.several("cost", cost, Cost, "a Cost")  # type: ignore[type-abstract]
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
        for k, rows in distribute(costs_of, tasks, pool):
            table[cuts[k]] = rows
            done += len(rows)
            if pool is not None:
                tell(done)
    return table[:, 0] if cost is None or isinstance(cost, Cost) else table


def costs_of(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    costs: Sequence[Cost],
    progress: ProgressCallback | None = None,
) -> FloatArray:
    """Return the costs of some runs, (runs, costs): one chunk of work, wherever it is done."""
    sums = [_Costs(costs, e.rows - 1) for e in experiments]
    found = measure(
        experiments, controllers, lambda i, rows: sums[i].take(rows), sums[0].signals, progress
    )
    return np.array([
        each.results(metrics) if outcome.completed else np.full(len(costs), np.inf)
        for each, (outcome, metrics) in zip(sums, found, strict=True)
    ])  # fmt: skip


@checked
def cost_of(run: Run, cost: Cost) -> float:
    """Return the cost of a recorded `Run`, as `evaluate` gives it; +inf where it diverged."""
    if not run.outcome.completed:
        return float("inf")
    sums, limit = _Costs([cost], run.planned_rows - 1), np.array(run.meta["effort_limit"])
    for first in range(0, len(run.t), BLOCK_ROWS):
        part = slice(first, first + BLOCK_ROWS)
        own = {name: getattr(run, name)[part] for name in ("t", *MOTION)}
        signals = {name: array[part] for name, array in run.signals.items()}
        sums.take(Rows(first, run.step, **own, signals=signals, limit=limit, arm=run.arm))
    return sums.results(run.metrics)[0]


class _Costs:
    """What a run costs: of its metrics, or of its rows, which stream by, all but the last."""

    def __init__(self, costs: Sequence[Cost], applied: int) -> None:
        self._applied, self._costs = applied, [cost.streamed() or cost for cost in costs]
        of_rows = [cost for cost in self._costs if isinstance(cost, RowCost)]
        self.signals = sorted({name for cost in of_rows for name in cost.signals})
        self._states = [(cost, cost.begin()) for cost in of_rows]

    def take(self, rows: Rows) -> None:
        """Take the next rows."""
        count = max(min(len(rows.q), self._applied - rows.first), 0)
        if not count or not self._states:
            return
        for name in self.signals:
            if name not in rows.signals:
                has = ", ".join(sorted(rows.signals)) or "none"
                raise ArgumentError("cost.signals", f"signals of the law ({has})", name)
        # Copies: a cost may keep them, and the engine uses its arrays again.
        own = {name: getattr(rows, name)[:count].copy() for name in ("t", *MOTION)}
        signals = {name: rows.signals[name][:count].copy() for name in self.signals}
        rows = dataclasses.replace(rows, **own, signals=signals)
        self._states = [(cost, cost.add(state, rows)) for cost, state in self._states]

    def results(self, metrics: Metrics) -> list[float]:
        """Return what the run costs, by each of the costs."""
        found, streamed = [], iter(self._states)
        for cost in self._costs:
            if isinstance(cost, RowCost):
                value = cost.finish(next(streamed)[1])
            else:
                value = cost.of(metrics)
            try:
                found.append(float(value))
            except (TypeError, ValueError):
                raise ArgumentError("cost", "a number", type(value).__name__) from None
        return found


def measure(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    take: Callable[[int, Rows], None] | None = None,
    keep: Sequence[str] = (),
    progress: ProgressCallback | None = None,
) -> list[tuple[Outcome, Metrics]]:
    """Simulate runs, whose rows and the signals `keep` go to `take`; return how they ended."""
    robots = start_robots(experiments, controllers, keep)
    outcomes = advance_all(robots, take, progress)
    return [
        (outcome, metrics_from(robot.sums, outcome.completed, e.step))
        for outcome, robot, e in zip(outcomes, robots, experiments, strict=True)
    ]


def start_robots(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    keep: Sequence[str] | None = None,
) -> list["Robot"]:
    """Start a robot for each pair.

    `keep` names the signals to record while figures of merit are summed up, by compiled dynamics
    where experiments do not say; None: all that laws show, by Pinocchio's, and no figures.
    """
    # Imported late, here and below: they load numba.
    from fpid_pin.control.state import State
    from fpid_pin.simulation.engine import Robot, horizon_of

    dynamics, robots = "pinocchio" if keep is None else "compiled", []
    for e, law in zip(experiments, controllers, strict=True):
        state = State(law, e.arm, step=e.step, horizon=horizon_of(e.duration))
        names = [*state.controller.shown, *state.shown] if keep is None else keep
        limit = None if keep is None else e.torque_limit
        robots.append(Robot(e, state, dynamics=e.dynamics or dynamics, keep=names, limit=limit))
    return robots


def advance_all(
    robots: Sequence["Robot"],
    take: Callable[[int, Rows], None] | None = None,
    progress: ProgressCallback | None = None,
) -> list[Outcome]:
    """Take robots to their ends, a block of rows after another, and return how they ended.

    Each robot's rows, views of arrays that are used again, go to `take` with its number.
    """
    from fpid_pin.simulation.engine import Block

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


def warm(experiments: Sequence[Experiment], controllers: Sequence[Controller]) -> None:
    """Run two ticks of each kind of law, so that workers find all kernels compiled."""
    kinds = {(type(c), e.arm.n): (e, c) for e, c in zip(experiments, controllers, strict=True)}
    for e, c in kinds.values():
        short = dataclasses.replace(e, duration=2.0 * e.step)
        costs_of([short], [c], [QuadraticCost()])
