"""Runs that share a call of the engine: sorting them, driving it, telling whose law went wrong."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence

import numpy as np

from fpid_pin import checks
from fpid_pin.control.controller import Controller
from fpid_pin.exceptions import ArgumentError, SimulationError
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import torque_limit
from fpid_pin.simulation.recorders import ALL_SIGNALS, BLOCK_ROWS, Batch, Outcome, Recorder
from fpid_pin.simulation.simulator import Simulator


def pair(
    experiments: Experiment | Sequence[Experiment], controllers: Controller | Sequence[Controller]
) -> tuple[list[Experiment], list[Controller]]:
    """Broadcast experiments and controllers against each other: equal lengths, or one is single."""
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


def batches(
    experiments: Sequence[Experiment], controllers: Sequence[Controller], most: int
) -> list[list[int]]:
    """Sort runs into calls of the engine: what must be alike in one call, at most `most` runs."""
    groups: dict[Hashable, list[int]] = {}
    for run, (e, c) in enumerate(zip(experiments, controllers, strict=True)):
        key = (c.lockstep_key(), e.arm, e.step, e.rows, e.integrator, e.dynamics)
        groups.setdefault(key, []).append(run)
    return [
        group[start : start + most]
        for group in groups.values()
        for start in range(0, len(group), most)
    ]


def lockstep(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    recorders: Sequence[Recorder],
    progress: ProgressCallback | None = None,
) -> list[Outcome]:
    """Simulate runs that share arm, step, duration, integrator and kind of controller.

    Parameters
    ----------
    experiments, controllers
        One a run.
    recorders
        What to do with the rows.
    progress
        Called every so many rows.

    Returns
    -------
    list of Outcome
        One a run; a diverged run does not disturb the others.

    Raises
    ------
    SimulationError
        A law of one's own that went wrong in company: which of the runs is to blame is not known.
        A single run ends with that as its cause.
    """
    rows, h = experiments[0].rows, experiments[0].step
    wanted = {name for recorder in recorders for name in recorder.wanted}
    keep = None if wanted & set(ALL_SIGNALS) else sorted(wanted)
    with np.errstate(all="ignore"):
        simulator = Simulator(experiments, controllers, keep=keep)
        arm, limits = experiments[0].arm, {id(e): torque_limit(e) for e in experiments}
        limit = np.array([limits[id(e)] for e in experiments])
        batch = Batch(len(experiments), arm.n, rows, h, limit, arm)
        for recorder in recorders:
            recorder.start(batch)
        fault = ""
        for first in range(0, rows, BLOCK_ROWS):
            try:
                simulator.tick(min(BLOCK_ROWS, rows - first))
            except SimulationError as error:
                if len(experiments) > 1:
                    raise
                fault = str(error)
            block = simulator.block()
            for recorder in recorders:
                recorder.take(block)
            if fault:
                return [Outcome(completed=False, time=simulator.t, cause=fault)]
            if not simulator.alive:
                break
            if progress is not None:
                progress(Progress((first + len(block.t)) / rows))
    done = Outcome(completed=True, time=(rows - 1) * h)
    # A run may be lost by the step after its last row, which is no part of it.
    return [end if end is not None and round(end.time / h) < rows else done
            for end in simulator.ends]  # fmt: skip


def apart_if_wrong(members: list[int], run: Callable[[list[int]], None]) -> None:
    """Run a batch; where a law goes wrong in company, find out whose by halving it."""
    try:
        run(members)
    except SimulationError:
        if len(members) == 1:
            raise
        half = len(members) // 2
        apart_if_wrong(members[:half], run)
        apart_if_wrong(members[half:], run)
