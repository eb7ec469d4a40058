"""What is kept of a golden run, and how far from it a run may be; makes runs.npz anew.

``python tests/golden/recording.py``; see README.md for when this is right.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from cases import CASES, SENSITIVE, Case
from numpy.typing import NDArray

import fpid_pin as fp

FloatArray = NDArray[np.float64]

#: The golden runs: arrays by ``<case>/<array>`` and ``<case>/<array>/sensitivity``, and outcomes.
FILE = Path(__file__).parent / "runs.npz"
#: One row in so many of a run is kept.
EVERY = 20
#: Signals of a law that are kept where it has them.
SIGNALS = ("kp", "ki", "kd", "u_s", "integral_order", "derivative_order")
#: Figures of merit, the rows of the array ``metrics``.
METRICS = (
    "ise", "iae", "itae", "rms", "rms_tail", "energy", "total_variation", "peak_torque",
    "peak_error", "settling_time", "overshoot", "saturated", "torque_rate",
)  # fmt: skip
#: How far the start is moved to see how sensitive a case is [rad].
SHIFT = 1e-12
#: The tolerance where a case is not sensitive: of q in rad; of all else over its size, at least 1.
SMALLEST = 1e-9
#: The tolerance of a sensitive case, over the difference that the moved start makes.
MARGIN = 100.0


def record(case: Case, shift: float = 0.0) -> tuple[str, dict[str, FloatArray]]:
    """Simulate a case, its start moved by `shift` [rad]; return the outcome and what is kept.

    Arrays are (rows, n), but for ``metrics``, (figures, n).
    """
    experiment = replace(case.experiment, q0=np.asarray(case.experiment.q0) + shift)
    run = fp.simulate(experiment, case.controller)
    names = ("q", "torque", *(name for name in SIGNALS if name in run.signals))
    kept = {name: np.array(getattr(run, name)[::EVERY]) for name in names}
    kept["metrics"] = np.array([getattr(run.metrics, name) for name in METRICS])
    return str(run.outcome), kept


def difference(one: FloatArray, other: FloatArray) -> FloatArray:
    """Return the largest difference in each row, (rows,); NaN or inf in both is none."""
    same = (one == other) | (np.isnan(one) & np.isnan(other))
    with np.errstate(invalid="ignore"):
        return np.max(np.where(same, 0.0, np.abs(one - other)), axis=1)


def tolerance(name: str, golden: FloatArray, sensitivity: FloatArray) -> FloatArray:
    """Return how far an array may be from the golden one, (rows,).

    Along a run the tolerance only grows: what made two runs differ goes on.
    """
    size = np.max(np.where(np.isfinite(golden), np.abs(golden), 0.0), axis=1)
    if name != "metrics":
        size, sensitivity = np.maximum.accumulate(size), np.maximum.accumulate(sensitivity)
    smallest = SMALLEST if name == "q" else SMALLEST * np.maximum(1.0, size)
    return np.maximum(smallest, MARGIN * sensitivity)


def main() -> None:
    """Simulate all cases three times, the start as it is and moved either way, and write them."""
    arrays: dict[str, FloatArray] = {}
    outcomes, sensitive = {}, set()
    for name, case in CASES.items():
        outcomes[name], golden = record(case)
        moved = [record(case, shift) for shift in (SHIFT, -SHIFT)]
        if any(outcome != outcomes[name] for outcome, _ in moved):
            raise SystemExit(f"{name}: its outcome hangs on {SHIFT:g} rad; choose another case")
        for key, array in golden.items():
            arrays[f"{name}/{key}"] = array
            found = np.max([difference(array, other[key]) for _, other in moved], axis=0)
            arrays[f"{name}/{key}/sensitivity"] = found
        if MARGIN * arrays[f"{name}/q/sensitivity"].max() > SMALLEST:
            sensitive.add(name)
    np.savez_compressed(FILE, outcomes=np.array(json.dumps(outcomes)), **arrays)
    sys.stdout.write(f"{len(CASES)} cases, {FILE.stat().st_size / 1e6:.2f} MB\n")
    for name in sorted(sensitive ^ SENSITIVE):
        what = "add to" if name in sensitive else "take from"
        sys.stdout.write(f"{what} SENSITIVE in cases.py: {name!r}\n")


if __name__ == "__main__":
    main()
