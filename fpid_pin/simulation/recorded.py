"""What is made of a run: arrays on a uniform clock, its origin, figures of merit, limits passed."""

import platform
from collections.abc import Mapping
from dataclasses import dataclass
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
        if name == "t" or (value is None and name in ("v", "v_ref")):
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


def metrics_from(sums: Any, completed: bool, step: float) -> Metrics:
    """Return the metrics of sums, `kernels.records.MEASURE`, of a run that was completed or not."""
    h = step
    stayed = completed & (sums["settled"] < sums["rows"])
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


def metrics_of(run: "Run", band: float = SETTLING_BAND) -> Metrics:
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
    return metrics_from(sums, run.outcome.completed, run.step)


# ---------------------------------------------------------------------- limits


@dataclass(frozen=True)
class Exceedance:
    """A joint's first step beyond one of its limits.

    Attributes
    ----------
    joint
        Its name.
    quantity
        ``"position"``, ``"velocity"`` or ``"effort"`` (the controller asked for all of it).
    limit
        [rad], [rad/s] or [N m] (of a prismatic joint [m], [m/s] or [N]); for positions the one
        that was passed.
    time
        When first [s].
    value
        The worst that followed.
    part
        Part of the run's samples beyond the limit.
    unit
        Of `limit` and `value`.
    """

    joint: str
    quantity: str
    limit: float
    time: float
    value: float
    part: float
    unit: str

    @property
    def passed(self) -> str:
        """Which limit in words: of positions the upper or the lower one."""
        if self.quantity != "position":
            return self.quantity
        return f"{'upper' if self.value > self.limit else 'lower'} position"

    def __str__(self) -> str:
        unit, share = self.unit, f"{100.0 * self.part:.3g} % of the time"
        if self.quantity == "effort":
            return (
                f"{self.joint}: at its effort limit of {self.limit:.3g} {unit} from "
                f"{self.time:.3g} s on, {share}"
            )
        return (
            f"{self.joint}: beyond its {self.passed} limit of {self.limit:.3g} {unit} at "
            f"{self.time:.3g} s (worst {self.value:.3g} {unit}, {share})"
        )


def asks_degrees(arm: Arm, run: "Run") -> str:
    """Return a line where a start or a reference of a joint that turns is too far for radians.

    That is beyond a whole turn, or five times as far as the joint's limits. Empty: nowhere.
    """
    farthest = np.abs(np.vstack([run.q[:1], run.q_ref])).max(axis=0, initial=0.0)
    limit = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    plausible = np.minimum(2.0 * np.pi, 5.0 * limit)
    excess = np.where(np.array(arm.units) == "rad", farthest / plausible, 0.0)
    j = int(np.argmax(excess))
    if not excess[j] > 1.0 + 1e-9:
        return ""
    known = f"limits {arm.lower[j]:.3g} and {arm.upper[j]:.3g} rad" if limit[j] < np.inf else ""
    return (
        f"{arm.name}: joint {arm.joint_names[j]} is to go to {farthest[j]:.3g} rad"
        f"{f' ({known})' if known else ''}: degrees? Angles are in rad"
    )


def limit_report(run: "Run") -> list[Exceedance]:
    """Return every limit of the nominal arm that `run` passed, the earliest first.

    Position and velocity limits do not stop a simulated joint; they are watched. A torque cannot
    pass its limit: listed is where it sat at it.
    """
    arm = run.arm
    speeds = [f"{unit}/s" for unit in arm.units]
    watched = (
        ("position", run.q, arm.lower - run.q, arm.lower, arm.units),
        ("position", run.q, run.q - arm.upper, arm.upper, arm.units),
        ("velocity", run.v, np.abs(run.v) - arm.velocity_limit, arm.velocity_limit, speeds),
        ("effort", run.torque, np.abs(run.torque) - arm.effort_limit, arm.effort_limit,
         arm.effort_units),
    )  # fmt: skip
    found = []
    for j, joint in enumerate(arm.joint_names):
        for quantity, values, excess, limits, units in watched:
            beyond = excess[:, j] >= 0.0 if quantity == "effort" else excess[:, j] > 0.0
            if np.isfinite(limits[j]) and beyond.any():
                first, worst = int(np.argmax(beyond)), int(np.argmax(excess[:, j]))
                time, value = float(run.t[first]), float(values[worst, j])
                about = (float(limits[j]), time, value, float(np.mean(beyond)), units[j])
                found.append(Exceedance(joint, quantity, *about))
    return sorted(found, key=lambda item: item.time)
