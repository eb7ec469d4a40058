"""What a comparison says: hand-made runs whose ranking is known."""

import dataclasses
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

import fpid_pin as fp
from fpid_pin.cli import comparison, table
from fpid_pin.costs import Metrics
from fpid_pin.simulation import Outcome

COMPLETED = Outcome(True, 1.0)


def entry(condition, controller, tail, outcome=COMPLETED):
    """A run of two joints whose tail errors are 3 and 4 times `tail` [rad]."""
    names = [field.name for field in dataclasses.fields(Metrics)]
    metrics = Metrics(**{name: np.array([3.0, 4.0]) for name in names})
    metrics = dataclasses.replace(metrics, rms_tail=tail * np.array([3.0, 4.0]))
    run = SimpleNamespace(metrics=metrics, outcome=outcome, name=controller)
    return comparison.Entry(condition, controller, run, f"{controller}.npz")


@pytest.fixture(autouse=True)
def _no_limits(monkeypatch):
    monkeypatch.setattr(comparison, "limit_report", lambda run: getattr(run, "limits", []))


def ranked(*entries, metric="tail"):
    return comparison.rank(entries, comparison.MEASURES[metric])


FIELD = [
    entry("calm", "A", 1e-3), entry("calm", "B", 2e-3), entry("calm", "C", 3e-3),
    entry("storm", "A", 9e-3), entry("storm", "B", 5e-3),
    entry("storm", "C", np.nan, Outcome(False, 0.3, "joint2", "speed is beyond 10 rad/s")),
    entry("rain", "A", 2e-3), entry("rain", "B", 3e-3), entry("rain", "C", 4e-3),
]  # fmt: skip


def test_figures_are_over_all_joints_and_infinite_where_a_run_ended():
    ranking = ranked(*FIELD)
    rms = 1e3 * np.sqrt((9.0 + 16.0) / 2.0)
    assert ranking.values == pytest.approx(
        rms * np.array([[1e-3, 2e-3, 3e-3], [9e-3, 5e-3, np.inf], [2e-3, 3e-3, 4e-3]])
    )
    assert ranking.conditions[ranking.hardest] == "storm"
    assert ranking.is_best("calm", "A")
    assert not ranking.is_best("storm", "C")


def test_the_answer_says_who_is_best_where_and_the_worst_of_each():
    first, second, third = comparison.answer(FIELD, ranked(*FIELD))
    assert first == "Least RMS error of the last half: A under calm and rain; B under storm."
    assert (
        second
        == "Worst case of each: B 17.7 mrad (storm); A 31.8 mrad (storm); C ended early (storm)."
    )
    assert third.startswith("Limits passed by C: storm, diverged at 0.3 s, joint2: speed")


def test_where_all_ended_early_nobody_is_best():
    gone = Outcome(False, 0.3, "joint1", "speed is not finite")
    lost = [entry("calm", "A", 1.0, gone), entry("calm", "B", 1.0, gone)]
    ranking = ranked(*lost)
    assert comparison.answer(lost, ranking)[0].endswith("nobody under calm, where all ended early.")
    assert not ranking.is_best("calm", "A")
    assert not np.isfinite(ranking.values).any()


def test_one_condition_names_the_margin_and_one_controller_has_no_rival():
    pair = [entry("nominal", "A", 1e-3), entry("nominal", "B", 2e-3)]
    assert comparison.answer(pair, ranked(*pair))[0] == (
        "Least RMS error of the last half: A, 3.54 mrad; next B, 7.07 mrad."
    )
    assert comparison.answer(pair[:1], ranked(*pair[:1])) == []


def test_limits_are_told_by_condition_and_quantity():
    one = entry("calm", "A", 1e-3)
    limit = fp.simulation.limits.Exceedance
    one.run.limits = [
        limit(joint, "effort", 5.0, 0.1, 5.0, part, "N m")
        for joint, part in (("j1", 0.25), ("j2", 0.5))
    ]
    assert comparison.limit_lines([one]) == [
        "Limits passed by A: effort limit of j1 25 % and j2 50 % of the time."
    ]
    assert [row["part [%]"] for row in comparison.limit_rows([one])] == [25.0, 50.0]


NAMES = [
    "adaptive FPID with a long name", "a_name_without_any_place_to_break_it_at_all", "PID", "x" * 60
]  # fmt: skip


@pytest.mark.parametrize("width", [80, 60])
def test_no_number_is_cut_in_a_narrow_terminal(width, capsys):
    field = [entry("a condition", name, 10.0 ** (7 - k)) for k, name in enumerate(NAMES)]
    rows = comparison.screen_rows(comparison.run_rows(field, ranked(*field)))
    console = Console(force_terminal=True, width=width, color_system=None)
    table.print_table(rows, "title", console=console)
    printed = capsys.readouterr().out
    if width == 80:
        assert max(map(len, printed.splitlines())) <= width
    assert "…" not in printed
    assert "..." not in printed
    for head in ("tail (all joints) [mrad]", "energy (all joints) [N²m²s]", "cost (33)"):
        assert all(table._short(row[head]) in printed for row in rows)
    # In a pipe a table is as wide as it has to be: names are whole, too.
    table.print_table(rows, "title")
    piped = capsys.readouterr().out
    assert all(name in piped for name in NAMES)
    assert all(table._short(row["energy (all joints) [N²m²s]"]) in piped for row in rows)


def test_columns_that_do_not_fit_follow_below_with_the_names_again(capsys):
    heads = [f"figure {k} [N m]" for k in range(12)]
    rows = [{"controller": f"law {j}"} | {h: 1.2345 * 10.0**k for k, h in enumerate(heads)}
            for j in range(3)]  # fmt: skip
    rows[1][heads[0]] = None  # not known
    table.print_table(rows, "", console=Console(force_terminal=True, width=80, color_system=None))
    printed = capsys.readouterr().out
    assert max(map(len, printed.splitlines())) <= 80
    for head in heads[1:]:
        assert printed.split().count(table._short(rows[0][head])) == 3
    assert printed.count("law 1") == printed.count("controller") == 2
    assert printed.split().count("-") == 1
