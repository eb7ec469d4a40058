"""What a comparison says: hand-made runs whose ranking is known, and whole ones."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Comparison, Outcome, comparison

COMPLETED, GONE = Outcome(True, 1.0), Outcome(False, 0.3, "joint2", "speed is beyond 10 rad/s")
NAMES = [field.name for field in dataclasses.fields(Metrics)]


def run(tail, outcome=COMPLETED):
    """A run of two joints whose tail errors are 3 and 4 times `tail` [rad]."""
    metrics = Metrics(**{name: np.array([3.0, 4.0]) for name in NAMES})
    metrics = dataclasses.replace(metrics, rms_tail=tail * np.array([3.0, 4.0]))
    return SimpleNamespace(metrics=metrics, outcome=outcome, limits=[])


@pytest.fixture(autouse=True)
def _no_limits(monkeypatch):
    monkeypatch.setattr(comparison, "limit_report", lambda run: run.limits)


def ranked(field, metric="tail"):
    """Return the comparison of a table of runs, by condition and controller."""
    runs = tuple(run for row in field.values() for run in row.values())
    laws = tuple(next(iter(field.values())))
    return Comparison(tuple(field), laws, runs, comparison.MEASURES[metric])


FIELD = ranked({
    "calm": {"A": run(1e-3), "B": run(2e-3), "C": run(3e-3)},
    "storm": {"A": run(9e-3), "B": run(5e-3), "C": run(np.nan, GONE)},
    "rain": {"A": run(2e-3), "B": run(3e-3), "C": run(4e-3)},
})  # fmt: skip


def test_figures_are_over_all_joints_and_infinite_where_a_run_ended():
    rms = 1e3 * np.sqrt((9.0 + 16.0) / 2.0)
    expected = rms * np.array([[1e-3, 2e-3, 3e-3], [9e-3, 5e-3, np.inf], [2e-3, 3e-3, 4e-3]])
    assert FIELD.values == pytest.approx(expected)
    assert FIELD.hardest == "storm"
    assert FIELD.is_best.tolist() == [
        [True, False, False],
        [False, True, False],
        [True] + 2 * [False],
    ]


def test_the_answer_says_who_is_best_where_and_the_worst_of_each():
    first, second, third = FIELD.answer
    assert first == "Least RMS error of the last half: A under calm and rain; B under storm."
    assert (
        second
        == "Worst case of each: B 17.7 mrad (storm); A 31.8 mrad (storm); C ended early (storm)."
    )
    assert third.startswith("Limits passed by C: storm, diverged at 0.3 s, joint2: speed")
    assert str(FIELD) == "\n".join(FIELD.answer)


def test_where_all_ended_early_nobody_is_best():
    lost = ranked({"calm": {"A": run(1.0, GONE), "B": run(1.0, GONE)}})
    assert lost.answer[0].endswith("nobody under calm, where all ended early.")
    assert not lost.is_best.any()
    assert not np.isfinite(lost.values).any()


def test_one_condition_names_the_margin_and_one_controller_has_no_rival():
    pair = {"A": run(1e-3), "B": run(2e-3)}
    margin = "Least RMS error of the last half: A, 3.54 mrad; next B, 7.07 mrad."
    assert ranked({"nominal": pair}).answer == [margin]
    assert ranked({"nominal": {"A": run(1e-3)}}).answer == []


def test_limits_are_told_by_condition_and_quantity():
    one = run(1e-3)
    limit = fp.simulation.limits.Exceedance
    one.limits = [
        limit(joint, "effort", 5.0, 0.1, 5.0, part, "N m")
        for joint, part in (("j1", 0.25), ("j2", 0.5))
    ]
    found = ranked({"calm": {"A": one}})
    assert found.answer == ["Limits passed by A: effort limit of j1 25 % and j2 50 % of the time."]
    assert [row["part [%]"] for row in found.limit_rows()] == [25.0, 50.0]


def test_a_script_compares_in_a_line_what_the_command_line_does(monkeypatch):
    monkeypatch.undo()
    experiment = fp.paper_experiment(duration=0.1)
    laws = [fp.paper_controller("symbol"), fp.paper_controller("integer")]
    found = fp.compare({"as it is": experiment, "again": experiment}, laws, "peak")
    assert found.controllers == ("FPID, published orders", "integer PID")
    alone = [run.metrics.peak_torque.max() for run in fp.simulate(experiment, laws)]
    assert found.values.tolist() == [alone, alone]
    assert [row["peak (worst joint) [N m]"] for row in found.rows()] == 2 * alone
    assert "<td>integer PID</td>" in found._repr_html_()
    with pytest.raises(ArgumentError, match="a name of its own each"):
        fp.compare(experiment, [laws[0], laws[0]])
    with pytest.raises(ArgumentError, match="metric: expected one of tail"):
        fp.compare(experiment, laws, "speed")
