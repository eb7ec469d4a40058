"""The configurations for `fpid-pin compare` among the examples: they load, and every pair runs."""

import dataclasses
from pathlib import Path

import pytest

import fpid_pin as fp
from fpid_pin.cli import config

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("compare_*.toml")), ids=lambda p: p.name)
def test_every_controller_runs_under_every_condition(path):
    found = config.load(path)
    assert len(found.controllers) >= 6
    assert len(found.conditions) >= 5
    pairs = [(e, c) for e in found.conditions.values() for c in found.controllers.values()]
    experiments = [dataclasses.replace(e, duration=0.02) for e, _ in pairs]
    runs = fp.simulate(experiments, [controller for _, controller in pairs])
    assert all(run.outcome.completed for run in runs)
    assert {run.name for run in runs} == set(found.controllers)
