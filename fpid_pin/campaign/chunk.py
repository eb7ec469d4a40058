"""Consecutive runs of a campaign simulated: the work of one task, wherever it is done."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fpid_pin.campaign.data import METRICS
from fpid_pin.campaign.study import Study
from fpid_pin.checks import FloatArray
from fpid_pin.control import Controller
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import FpidError
from fpid_pin.simulation import Experiment, Outcome

#: Faults of the machine, which no run is to blame for.
_NOT_THE_RUN = (MemoryError, ImportError, OSError)
_NO_FIGURES = (math.nan,) * len(METRICS)


@dataclass(frozen=True)
class Ended:
    """How a run ended under a controller: see `CampaignData`; figures are those of `METRICS`."""

    outcome: str
    cause: str
    figures: tuple[float, ...] = _NO_FIGURES


@dataclass(frozen=True, eq=False)
class Done:
    """Results of consecutive runs: samples (runs, parameters), for each one end a controller."""

    samples: FloatArray
    ends: Sequence[Sequence[Ended]]


def run_chunk(study: Study, first: int, last: int) -> Done:
    """Simulate runs `first` to `last` - 1 under every controller."""
    samples = study.samples(first, last)
    return Done(samples, [_ends(study, first + k, sample) for k, sample in enumerate(samples)])


def _ends(study: Study, run: int, sample: FloatArray) -> list[Ended]:
    """Simulate a run under every controller; what fails under one leaves the others alone."""
    try:
        experiment = study.experiment_of(run, sample)
    except _NOT_THE_RUN:
        raise
    except Exception as error:
        return [_fault(error)] * len(study.laws)
    return [_end(experiment, law) for law in study.laws]


def _end(experiment: Experiment, law: Controller) -> Ended:
    # Imported late: it loads numba.
    from fpid_pin.simulation.batch import measure

    try:
        ((outcome, metrics),) = measure([experiment], [law])
    except _NOT_THE_RUN:
        raise
    except Exception as error:
        return _fault(error)
    return ended(experiment.arm.joint_names, outcome, metrics)


def _fault(error: Exception) -> Ended:
    """Return the end of a run whose disturbance, reference or law, of the user's own, failed."""
    kind = "" if isinstance(error, FpidError) else f"{type(error).__name__}: "
    return Ended("failed", f"{kind}{error}")


def ended(joints: Sequence[str], outcome: Outcome, metrics: Metrics) -> Ended:
    """Return how a run ended, by its outcome and metrics.

    A run that was completed counts as saturated if at any sample a joint's torque was at its limit;
    the cause says which joint the most, and how long.
    """
    if not outcome.completed:
        if outcome.joint:
            cause = f"{outcome.joint} at {outcome.time:g} s: {outcome.cause}"
            return Ended("diverged", cause)
        return Ended("failed", f"{outcome.cause} (at {outcome.time:g} s)")
    figures = tuple(metric.of(getattr(metrics, name)) for name, metric in METRICS.items())
    worst = int(np.argmax(np.nan_to_num(metrics.saturated)))
    share = float(metrics.saturated[worst])
    if share > 0.0:
        cause = f"{joints[worst]} at its effort limit {100.0 * share:.3g} % of the time"
        return Ended("saturated", cause, figures)
    return Ended("completed", "", figures)
