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


def run(tail, outcome=COMPLETED, kind="fpid", variation=1.0):
    """A run of two joints whose tail errors are 3 and 4 times `tail` [rad]."""
    metrics = Metrics(**{name: np.array([3.0, 4.0]) for name in NAMES})
    metrics = dataclasses.replace(
        metrics,
        rms_tail=tail * np.array([3.0, 4.0]),
        total_variation=variation * metrics.total_variation,
    )
    meta, arm = {"controller": {"kind": kind}}, SimpleNamespace(units=("rad",))
    return SimpleNamespace(metrics=metrics, outcome=outcome, limits=[], meta=meta, arm=arm)


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
    first, second, third, fourth = FIELD.answer
    assert first == (
        "Least RMS error of the last half under storm: B, 17.7 mrad; 56 % of A (31.8 mrad). "
        "Its torque varies as much as that of A."
    )
    assert second == "Best by condition: A under calm and rain; B under storm."
    assert (
        third
        == "Worst case of each: B 17.7 mrad (storm); A 31.8 mrad (storm); C ended early (storm)."
    )
    assert fourth.startswith("Limits passed by C: storm, diverged at 0.3 s, joint2: speed")
    assert str(FIELD) == "\n".join(FIELD.answer)


def test_where_all_ended_early_nobody_is_best():
    lost = ranked({
        "calm": {"A": run(1.0, GONE), "B": run(1.0, GONE)},
        "rain": {"A": run(1.0, GONE), "B": run(1.0)},
    })  # fmt: skip
    assert lost.answer[0] == (
        "Least RMS error of the last half under calm: nobody; all ended early."
    )
    assert lost.answer[1].endswith("B under rain; nobody under calm, where all ended early.")
    assert lost.is_best.tolist() == [[False, False], [False, True]]
    alone = ranked({"rain": {"A": run(1.0, GONE), "B": run(1.0)}})
    assert alone.answer[0].endswith("B, 3540 mrad; A ended early.")


#: Of what a user asks: the best law, the same with integer orders, a rival, and what is used now.
NOW, RIVAL = run(30.1e-3, variation=3.0), run(3e-3, kind="computed_torque", variation=0.5)
NEW, INTEGER = run(1e-3, variation=1.18), run(1.02e-3)


def test_the_first_sentence_is_over_what_the_user_has_names_ties_and_what_the_torque_costs():
    found = ranked({"nominal": {"now": NOW, "rival": RIVAL, "new": NEW, "integer": INTEGER}})
    assert found.answer == [
        "Least RMS error of the last half: new, 3.54 mrad; a tie with integer (3.61 mrad); a third "
        "of rival (10.6 mrad) and a thirtieth of now (106 mrad). Its torque varies 18 % more than "
        "that of integer and 2.4 times that of rival."
    ]
    by = ranked({"nominal": {"now": NOW, "rival": RIVAL}}, "variation").answer
    assert by == ["Least torque variation (sum of joints): rival, 3.5 N m; 17 % of now (21 N m)."]
    several = ranked({name: {"new": NEW, "integer": INTEGER, "rival": RIVAL} for name in "ab"})
    assert several.answer[1] == "Best by condition: new and integer alike under a and b."
    assert ranked({"nominal": {"A": run(1e-3)}}).answer == []


def test_limits_are_told_by_condition_and_quantity():
    one = run(1e-3)
    limit = fp.simulation.Exceedance
    one.limits = [
        limit(joint, "effort", 5.0, 0.1, 5.0, part, "N m")
        for joint, part in (("j1", 0.25), ("j2", 0.996))
    ]
    one.limits += [limit("j1", "position", edge, 0.1, 2.0 * edge, 0.5, "rad") for edge in (-1, 1)]
    found = ranked({"calm": {"A": one}})
    assert found.answer == [
        "Limits passed by A: effort limit of j1 25 % and j2 100 % of the time; lower position "
        "limit of j1 50 % of the time; upper position limit of j1 50 % of the time."
    ]
    assert [row["part [%]"] for row in found.limit_rows()] == [25.0, 99.6, 50.0, 50.0]
    assert [row["quantity"] for row in found.limit_rows()[2:]] == [
        "lower position [rad]", "upper position [rad]",
    ]  # fmt: skip
    assert str(one.limits[2]).startswith("j1: beyond its lower position limit of -1 rad at 0.1 s")


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
