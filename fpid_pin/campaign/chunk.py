"""Consecutive runs of a campaign simulated: the work of one task, wherever it is done."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from fpid_pin import own_code
from fpid_pin._version import __version__
from fpid_pin.campaign.data import METRICS
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray
from fpid_pin.control import Controller
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import FpidError
from fpid_pin.simulation import Experiment, Outcome
from fpid_pin.simulation.metrics import metrics_from

#: Faults of the machine, which no run is to blame for.
_NOT_THE_RUN = (MemoryError, ImportError, OSError)


@dataclass(frozen=True)
class Ended:
    """How one run ended under one controller.

    Attributes
    ----------
    outcome, cause
        See `CampaignData`.
    figures
        In the order of `METRICS`; NaN where it was not completed.
    """

    outcome: str
    cause: str
    figures: tuple[float, ...]


def failed(cause: str) -> Ended:
    """Return the end of a run that could not be simulated."""
    return Ended("failed", cause, (math.nan,) * len(METRICS))


def _fault(error: Exception) -> Ended:
    """Return the end of a run whose disturbance, reference or law, of the user's own, failed."""
    kind = "" if isinstance(error, FpidError) else f"{type(error).__name__}: "
    return failed(f"{kind}{error}")


@dataclass(frozen=True, eq=False)
class Done:
    """A chunk's results: runs from `first` on.

    Attributes
    ----------
    first
        Number of the first run.
    samples
        (runs, parameters).
    ends
        For each run one of each controller.
    """

    first: int
    samples: FloatArray
    ends: Sequence[Sequence[Ended]]


@dataclass(frozen=True, eq=False)
class Job:
    """What a task takes with it.

    Parameters
    ----------
    study
        The campaign.
    version
        Of the package that sends it.
    own
        Files of the user's with kinds of their own, which are run before.
    """

    study: Study
    version: str = __version__
    own: Sequence[str] = ()


def run_chunk(job: Job, first: int, last: int) -> Done:
    """Simulate runs `first` to `last` - 1 under every controller.

    Raises
    ------
    FpidError
        This process has another version of the package than the one that sent the job.
    """
    if job.version != __version__:
        raise FpidError(f"workers: expected fpid_pin {job.version}, as here, got {__version__}")
    own_code.load_again(list(job.own))
    study = job.study
    samples = study.bound.samples(first, last)
    ends = [_ends(study, first + row, sample) for row, sample in enumerate(samples)]
    return Done(first, samples, ends)


def _ends(study: Study, run: int, sample: FloatArray) -> list[Ended]:
    """Simulate a run under every controller; what fails under one leaves the others alone."""
    try:
        experiment = study.bound.experiment(run, sample)
    except _NOT_THE_RUN:
        raise
    except Exception as error:
        return [_fault(error)] * len(study.names)
    return [_end(experiment, law) for law in study.laws]


def _end(experiment: Experiment, law: Controller) -> Ended:
    """Simulate one run."""
    # Imported late: it loads numba.
    from fpid_pin.simulation.batch import advance_all, start_robots

    try:
        (robot,) = start_robots([experiment], [law], dynamics="compiled", measures=True)
        (outcome,) = advance_all([robot])
    except _NOT_THE_RUN:
        raise
    except Exception as error:
        return _fault(error)
    metrics = metrics_from(robot.sums, experiment.rows - 1, experiment.step)
    return ended(experiment.arm.joint_names, outcome, metrics)


def ended(joints: Sequence[str], outcome: Outcome, metrics: Metrics) -> Ended:
    """Return how a run ended, by its outcome and metrics.

    A run that was completed counts as saturated if at any sample a joint's torque was at its limit;
    the cause says which joint the most, and how long.
    """
    nothing = (math.nan,) * len(METRICS)
    if not outcome.completed:
        if outcome.joint:
            return Ended(
                "diverged", f"{outcome.joint} at {outcome.time:g} s: {outcome.cause}", nothing
            )
        return Ended("failed", f"{outcome.cause} (at {outcome.time:g} s)", nothing)
    values = figures(metrics)
    at_limit = np.nan_to_num(np.asarray(metrics.saturated))
    worst = int(np.argmax(at_limit))
    if at_limit[worst] > 0.0:
        share = f"{100.0 * at_limit[worst]:.3g} % of the time"
        return Ended("saturated", f"{joints[worst]} at its effort limit {share}", values)
    return Ended("completed", "", values)


def figures(metrics: Metrics) -> tuple[float, ...]:
    """Return the figures of a run, over its joints, in the order of `METRICS`."""
    numbers = {name: np.asarray(getattr(metrics, name)).tolist() for name in METRICS}
    rules: dict[str, Callable[[Sequence[float]], float]] = {
        "rms": _quadratic_mean,
        "rms_tail": _quadratic_mean,
        "peak_torque": max,
    }
    return tuple(float(rules.get(name, math.fsum)(numbers[name])) for name in METRICS)


def _quadratic_mean(values: Sequence[float]) -> float:
    return math.sqrt(math.fsum(x * x for x in values) / len(values))
