"""The engine gives the numbers that it gave when runs.npz was made.

``python tests/golden/test_golden.py`` makes it anew; README.md says when this is right.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from cases import CASES

import fpid_pin as fp

FILE = Path(__file__).parent / "runs.npz"
#: Signals of a law that are kept where it has them, one row in twenty.
SIGNALS = ("kp", "ki", "kd", "u_s", "integral_order", "derivative_order")


def record(experiment, controller):
    """Simulate a case; return its outcome and the arrays that are kept, (rows, n)."""
    run = fp.simulate(experiment, controller)
    names = ("q", "torque", *(name for name in SIGNALS if name in run.signals))
    kept = {name: np.array(getattr(run, name)[::20]) for name in names}
    kept["metrics"] = np.array([getattr(run.metrics, name) for name in fp.costs.METRICS])
    return str(run.outcome), kept


@pytest.fixture(scope="module")
def golden():
    with np.load(FILE) as file:
        return {name: file[name] for name in file.files}


@pytest.mark.parametrize("name", CASES)
def test_a_case_runs_as_it_did(golden, name):
    outcome, kept = record(*CASES[name])
    assert outcome == json.loads(str(golden["outcomes"]))[name]
    assert {f"{name}/{key}" for key in kept} == {x for x in golden if x.startswith(f"{name}/")}
    for key, array in kept.items():
        known = golden[f"{name}/{key}"]
        # Angles within 1e-9 rad; all else within 1e-9 of its size, which is at least 1.
        size = np.abs(known).max(axis=1, keepdims=True, where=np.isfinite(known), initial=1.0)
        most = 1e-9 * (1.0 if key == "q" else size)
        assert np.isclose(array, known, rtol=0.0, atol=most, equal_nan=True).all(), key


def test_the_file_has_these_cases_and_no_others(golden):
    assert list(json.loads(str(golden["outcomes"]))) == list(CASES)
    assert {key.split("/")[0] for key in golden} == {"outcomes", *CASES}


if __name__ == "__main__":
    found = {name: record(*case) for name, case in CASES.items()}
    outcomes = json.dumps({name: outcome for name, (outcome, _) in found.items()})
    arrays = {f"{name}/{key}": a for name, (_, kept) in found.items() for key, a in kept.items()}
    np.savez_compressed(FILE, outcomes=np.array(outcomes), **arrays)
