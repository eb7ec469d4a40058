"""The engine gives the numbers that it gave when runs.npz was made."""

import json

import numpy as np
import pytest
from cases import CASES, SENSITIVE
from recording import FILE, MARGIN, SMALLEST, difference, record, tolerance


@pytest.fixture(scope="module")
def golden():
    with np.load(FILE) as file:
        return {name: file[name] for name in file.files}


def too_far(golden, name, kept):
    """Return a line for each array that is further from the golden one than it may be."""
    found = []
    for key, array in kept.items():
        known = golden[f"{name}/{key}"]
        if known.shape != array.shape:
            found.append(f"{key}: shape {array.shape} instead of {known.shape}")
            continue
        off = difference(known, array)
        most = tolerance(key, known, golden[f"{name}/{key}/sensitivity"])
        # Written so that NaN, where the golden run has none, is too far.
        beyond = np.flatnonzero(~(off <= most))
        if len(beyond):
            row = int(beyond[0])
            found.append(f"{key}: row {row} is {off[row]:.2g} off, at most {most[row]:.2g}")
    return found


@pytest.mark.parametrize("name", CASES)
def test_a_case_runs_as_it_did(golden, name):
    outcome, kept = record(CASES[name])
    assert outcome == json.loads(str(golden["outcomes"]))[name]
    stored = {key.split("/")[1] for key in golden if key.startswith(f"{name}/")}
    assert set(kept) == stored
    assert too_far(golden, name, kept) == []


def test_the_file_has_these_cases_and_no_others(golden):
    assert list(json.loads(str(golden["outcomes"]))) == list(CASES)
    assert {key.split("/")[0] for key in golden} == {"outcomes", *CASES}


def test_only_cases_that_are_named_are_compared_less_strictly(golden):
    strict = {name for name in CASES if MARGIN * golden[f"{name}/q/sensitivity"].max() <= SMALLEST}
    assert set(CASES) - strict == SENSITIVE
    assert all(golden[f"{name}/q/sensitivity"].max() < 1e-9 for name in SENSITIVE)


@pytest.mark.parametrize("key", ["q", "torque", "kp", "metrics"])
def test_a_small_difference_is_seen(golden, key):
    name = "ur5: FPID"
    kept = {"q": golden[f"{name}/q"], key: golden[f"{name}/{key}"].copy()}
    assert too_far(golden, name, kept) == []
    kept[key][-1] += 1e-9 * np.maximum(1.0, np.abs(kept[key]).max()) * 2.0
    assert len(too_far(golden, name, kept)) == 1
    kept[key][-1] = np.nan
    assert len(too_far(golden, name, kept)) == 1
