"""The configurations for `fpid-pin compare` among the examples: they load, and every pair runs."""

import dataclasses
from pathlib import Path

import pytest

import fpid_pin as fp
from fpid_pin.cli.configuration import load
from fpid_pin.cli.plans import read_plan

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("compare_*.toml")), ids=lambda p: p.name)
def test_every_controller_runs_under_every_condition(path):
    found = load(path)
    assert len(found.controllers) >= 6
    assert len(found.conditions) >= 5
    pairs = [(e, c) for e in found.conditions.values() for c in found.controllers.values()]
    experiments = [dataclasses.replace(e, duration=0.02) for e, _ in pairs]
    runs = fp.simulate(experiments, [controller for _, controller in pairs])
    assert all(run.outcome.completed for run in runs)
    assert {run.name for run in runs} == set(found.controllers)


def test_the_search_s_example_is_the_paper_s():
    plan = read_plan(load(EXAMPLES / "tune_two_link.toml"))
    settings = plan.settings
    assert (settings.population, settings.generations) == (60, 80)
    assert (settings.crossover, settings.mutation) == (0.75, 0.03)
    assert (plan.cost.w1, plan.cost.w2) == (1.0, 0.0)
