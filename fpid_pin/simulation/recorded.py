"""Runs that somebody else made: another simulator, a robot."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.blocks import Outcome
from fpid_pin.simulation.run_meta import meta_of

#: Part of a step by which a row's time may be off the grid; a run is measured as if it were on it.
JITTER = 0.1


def run_arguments(
    t: ArrayLike, q: ArrayLike, q_ref: ArrayLike, torque: ArrayLike, *, arm: Arm,
    v: ArrayLike | None, v_ref: ArrayLike | None, signals: Mapping[str, ArrayLike] | None,
    controller: Controller | None, name: str, resample: float | None,
) -> dict[str, Any]:  # fmt: skip
    """Return the arguments of the `Run` that arrays are: see `Run.from_arrays`."""
    checks.instance("arm", arm, Arm, "an Arm")
    if controller is not None:
        checks.instance("controller", controller, Controller, "a Controller")
    time = checks.floats("t", t)
    if time.ndim != 1 or len(time) < 2:
        raise ArgumentError("t", "(N,) with at least 2 rows", f"shape {time.shape}")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if backwards.size:
        k = int(backwards[0]) + 1
        raise ArgumentError("t", "times that increase", f"{time[k]:g} s in row {k}")
    rows, n = len(time), arm.n
    given = {"q": q, "q_ref": q_ref, "torque": torque, "v": v, "v_ref": v_ref}
    arrays = {
        key: _rows(key, value, ((rows, n),)) for key, value in given.items() if value is not None
    }
    own = {
        key: _rows(f"signals.{key}", value, ((rows, n), (rows,)))
        for key, value in (signals or {}).items()
    }
    for rate, angle in (("v", "q"), ("v_ref", "q_ref")):
        if rate not in arrays:
            arrays[rate] = np.gradient(arrays[angle], time, axis=0)
    time = time - time[0]
    if resample is None:
        step = _uniform(time)
    else:
        step = checks.number("resample", resample, above=0.0)
        grid = step * np.arange(checks.sample_count(float(time[-1]), step), dtype=np.float64)
        arrays, own = (
            {key: _interpolated(grid, time, array) for key, array in table.items()}
            for table in (arrays, own)
        )
        time = grid
    return {
        "t": step * np.arange(len(time), dtype=np.float64), **arrays, "signals": own,
        "outcome": Outcome(True, step * (len(time) - 1)), "step": step, "planned_rows": len(time),
        "meta": meta_of(name, arm, controller, arm.effort_limit),
    }  # fmt: skip


def _rows(name: str, value: ArrayLike, shapes: tuple[tuple[int, ...], ...]) -> FloatArray:
    array = checks.floats(name, value)
    if array.shape not in shapes:
        expected = f"shape {shapes[0]} (rows, joints)"
        raise ArgumentError(name, expected, f"shape {array.shape}")
    return array.copy()


def _uniform(time: FloatArray) -> float:
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


def _interpolated(grid: FloatArray, time: FloatArray, array: FloatArray) -> Any:
    columns = array.reshape(len(time), -1).T
    found = np.stack([np.interp(grid, time, column) for column in columns], axis=1)
    return found.reshape(len(grid), *array.shape[1:])
