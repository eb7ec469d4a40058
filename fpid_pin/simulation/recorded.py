"""What goes into a run: arrays from elsewhere on a uniform clock, and where it came from."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from typing import Any

import numpy as np
import pinocchio
import scipy
from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.experiment import Experiment

#: Fraction of a step by which a row's time may be off the grid; it is measured as if on it.
JITTER = 0.1


def on_a_clock(
    t: ArrayLike, motion: Mapping[str, ArrayLike], signals: Mapping[str, ArrayLike], n: int,
    resample: float | None,
) -> tuple[float, FloatArray, dict[str, FloatArray], dict[str, FloatArray]]:  # fmt: skip
    """Return a step, times k h, and the motion and signals at these times: see `Run.from_arrays`.

    Rates that are not given are differences of the angles.
    """
    time = checks.floats("t", t)
    if time.ndim != 1 or len(time) < 2:
        raise ArgumentError("t", "(N,) with at least 2 rows", f"shape {time.shape}")
    back = np.flatnonzero(np.diff(time) <= 0.0)
    if back.size:
        k = int(back[0]) + 1
        raise ArgumentError("t", "times that increase", f"{time[k]:g} s in row {k}")
    time, rows = time - time[0], len(time)
    own = {key: _array(key, value, ((rows, n),)) for key, value in motion.items()}
    shapes = ((rows, n), (rows,))
    others = {key: _array(f"signals.{key}", value, shapes) for key, value in signals.items()}
    for rate, angle in (("v", "q"), ("v_ref", "q_ref")):
        if rate not in own:
            own[rate] = np.gradient(own[angle], time, axis=0)
    if resample is None:
        step = _uniform_step(time)
        return step, step * np.arange(rows, dtype=np.float64), own, others
    step = checks.number("resample", resample, above=0.0)
    count = checks.sample_count(float(time[-1]), step)
    grid: FloatArray = step * np.arange(count, dtype=np.float64)
    own, others = (
        {key: _interpolated(grid, time, array) for key, array in table.items()}
        for table in (own, others)
    )
    return step, grid, own, others


def _array(name: str, value: ArrayLike, shapes: tuple[tuple[int, ...], ...]) -> FloatArray:
    array = checks.floats(name, value)
    if array.shape not in shapes:
        raise ArgumentError(name, f"shape {shapes[0]} (rows, joints)", f"shape {array.shape}")
    return array.copy()


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


def _interpolated(grid: FloatArray, time: FloatArray, array: FloatArray) -> FloatArray:
    columns = array.reshape(len(time), -1).T
    found = np.stack([np.interp(grid, time, column) for column in columns], axis=1)
    return found.reshape(len(grid), *array.shape[1:])


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
