"""What a run is made of: arrays on a uniform clock, figures of merit, and where it came from."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio
import scipy

from fpid_pin import checks, descriptions
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.costs import SETTLING_BAND, Metrics
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.experiment import Experiment

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run

#: Fraction of a step by which a row's time may be off the grid; it is measured as if on it.
JITTER = 0.1
#: What the names of a law's signals begin with among a run's arrays.
SIGNAL = "signal_"


def on_a_clock(
    given: Mapping[str, Any], n: int, resample: float | None
) -> tuple[float, dict[str, FloatArray]]:
    """Return a step, and the arrays of a run at times k h: see `Run.from_arrays`.

    Rates that are not given are differences of the angles.
    """
    time = checks.times("t", given["t"])
    time, rows, arrays = time - time[0], len(time), {}
    for name, value in given.items():
        if name == "t" or value is None:
            continue
        array = checks.floats(label := name.replace(SIGNAL, "signals."), value)
        if array.shape != (rows, n) and not (name.startswith(SIGNAL) and array.shape == (rows,)):
            raise ArgumentError(label, f"shape {(rows, n)} (rows, joints)", f"shape {array.shape}")
        arrays[name] = array.copy()
    for rate, angle in (("v", "q"), ("v_ref", "q_ref")):
        if rate not in arrays:
            arrays[rate] = np.gradient(arrays[angle], time, axis=0)
    if resample is None:
        step = _uniform_step(time)
        return step, {"t": step * np.arange(rows, dtype=np.float64)} | arrays
    step = checks.number("resample", resample, above=0.0)
    grid = step * np.arange(checks.sample_count(float(time[-1]), step), dtype=np.float64)

    def interpolated(column: FloatArray) -> FloatArray:
        return np.interp(grid, time, column)

    return step, {"t": grid} | {
        name: np.apply_along_axis(interpolated, 0, array) for name, array in arrays.items()
    }


def _uniform_step(time: FloatArray) -> float:
    step = float(time[-1]) / (len(time) - 1)
    checks.number("t's step", step, low=checks.STEPS[0], high=checks.STEPS[1])
    off = np.abs(time - step * np.arange(len(time)))
    worst = int(np.argmax(off))
    if off[worst] > JITTER * step:
        raise ArgumentError(
            "t", f"a step of {step:g} s throughout (or resample={step:.3g})",
            f"row {worst} off by {off[worst]:.3g} s",
        )  # fmt: skip
    return step


def describe_run(experiment: Experiment, controller: Controller, dynamics: str) -> dict[str, Any]:
    """Return the `Run.meta` of a run about to be recorded, with the dynamics that made it."""
    name, limit = getattr(controller, "name", ""), experiment.torque_limit
    table = descriptions.to_dict(experiment) | {"dynamics": dynamics}
    about = {"seed": experiment.seed, "experiment": table}
    return meta_of(name, experiment.arm, controller, limit) | about


def meta_of(
    name: str, arm: Arm, controller: Controller | None, effort_limit: FloatArray
) -> dict[str, Any]:
    """Return the `Run.meta` of a run that no experiment of ours has made."""
    elsewhere = {"kind": "custom", "repr": "recorded elsewhere"}
    return {
        "name": name,
        "versions": {
            "fpid_pin": __version__,
            "pin": pinocchio.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "platform": platform.platform(),
        "effort_limit": effort_limit.tolist(),
        "experiment": elsewhere,
        "controller": elsewhere if controller is None else descriptions.to_dict(controller),
        "arm": descriptions.to_dict(arm),
    }


def metrics_from(sums: Any, planned: int, step: float) -> Metrics:
    """Return the metrics of sums, `kernels.records.MEASURE`, of a run of `planned` + 1 rows."""
    h = step
    stayed = (sums["rows"] == planned) & (sums["settled"] < sums["rows"])
    with np.errstate(divide="ignore", invalid="ignore"):
        return Metrics(
            ise=h * sums["square"],
            iae=h * sums["absolute"],
            itae=h * sums["aged"],
            rms=np.sqrt(sums["square"] / sums["rows"]),
            rms_tail=np.sqrt(sums["late"] / sums["late_rows"]),
            energy=h * sums["effort"],
            total_variation=sums["changes"].copy(),
            peak_torque=sums["peak"].copy(),
            peak_error=sums["worst"].copy(),
            settling_time=np.where(stayed, h * sums["settled"], np.inf),
            overshoot=np.where(np.abs(sums["start"]) > sums["band"], sums["beyond"], 0.0),
            saturated=sums["at_limit"] / sums["rows"],
            torque_rate=np.sqrt(sums["jumps"] / (sums["rows"] - 1)) / h,
        )


def metrics_of(run: Run, band: float = SETTLING_BAND) -> Metrics:
    """Return the metrics of a recorded run: the same bits as while it ran.

    Parameters
    ----------
    run
        A `Run` of any origin.
    band
        Within which the error counts as settled [rad].
    """
    # Imported late: it loads numba.
    from fpid_pin.kernels.records import MEASURE
    from fpid_pin.kernels.rollout import measure_rows

    measure: Any = measure_rows
    planned = run.planned_rows - 1
    sums = np.zeros(run.q.shape[1], MEASURE)
    sums["band"] = checks.number("band", band, above=0.0)
    sums["limit"] = run.meta["effort_limit"]
    motion = np.stack([getattr(run, name)[:planned] for name in ("q", "v", "torque")])
    reference = np.array(run.q_ref[np.newaxis, :planned])
    measure(sums, reference, motion, planned // 2, run.step)
    return metrics_from(sums, planned, run.step)
