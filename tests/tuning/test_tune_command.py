import tomllib
from importlib import resources

import pytest

import fpid_pin as fp
from fpid_pin.cli.configuration import load
from fpid_pin.cli.tune import read_plan, run_tuning
from fpid_pin.costs import QuadraticCost
from fpid_pin.exceptions import TuningError

TUNE = """
[tune]
population = 6
generations = 2
seeds = [0, 1]
map_points = 3
[tune.cost]
kind = "quadratic_cost"
w2 = 0.0
[tune.space]
integral_order = [0, 1]
derivative_order = { low = 0.1, high = 1, shared = true }
kp = [1, 100, "log"]
"""


def written(tmp_path, tune=TUNE, more=""):
    text = resources.files("fpid_pin.cli").joinpath("demo.toml").read_text(encoding="utf-8")
    text = text.replace("step = 1e-3", "step = 5e-3").replace("duration = 20.0", "duration = 0.5")
    path = tmp_path / "study.toml"
    path.write_text(text + more + tune, encoding="utf-8")
    return path


def test_it_writes_what_it_promises_and_resumes(tmp_path, capsys):
    path, out = written(tmp_path), tmp_path / "out"
    result = run_tuning(path, out)
    names = {file.name for file in out.iterdir()}
    assert {
        "tuned.toml", "history.csv", "convergence.svg", "cost-map.svg", "profile.svg",
        "comparison.svg", "summary.md", "report.html", "config.toml", "checkpoint.npz", "tuned.npz",
        "fpid-published-orders.npz", "integer-orders.npz",
    } <= names  # fmt: skip
    assert [file.name for file in tmp_path.iterdir() if file not in (path, out)] == []
    shown = capsys.readouterr().out
    assert "cost tuned for" in shown
    assert "integer orders" in shown

    tuned = fp.Run.load(out / "tuned.npz")
    assert QuadraticCost(1.0, 0.0).of(tuned.metrics) == result.cost
    assert "tune" not in tomllib.loads((out / "tuned.toml").read_text())
    assert len((out / "history.csv").read_text().splitlines()) == 1 + 2 * 2

    head, *lines = str(result).splitlines()
    assert head == result.summary
    assert [line.split()[0] for line in lines] == list(result.parameters)

    again = run_tuning(path, out, resume=True)
    assert again.cost == result.cost
    before = (out / "history.csv").read_text()
    with pytest.raises(TuningError, match="another search: population is 6 there and 8 here"):
        run_tuning(written(tmp_path, TUNE.replace("= 6", "= 8")), out, resume=True)
    assert (out / "history.csv").read_text() == before
    # What it took up from the folder does not stay beside it, to be taken for a search's own.
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out", "study.toml"]


def test_a_robust_search_on_another_arm_goes_through_every_condition(tmp_path, capsys):
    conditions = """
[[condition]]
name = "bare"

[[condition]]
name = "loaded"
plant = { payload = { mass = 0.5 } }
"""
    tune = TUNE.replace("map_points = 3", "map_points = 3\nprofile_points = 0")
    tune = tune.replace("seeds = [0, 1]", "seeds = [0]")
    path = written(tmp_path, tune, conditions)
    text = path.read_text("utf-8")
    assert 'kind = "two_link"' in text
    other = 'kind = "planar"\nlengths = [1.0, 1.0]\nmasses = [1.0, 2.0]'
    text = text.replace("[0.901, 0.931]", "[0.9, 0.9]").replace('kind = "two_link"', other)
    path.write_text(text, encoding="utf-8")
    plan = read_plan(load(path))
    assert list(plan.experiments) == ["bare", "loaded"]
    result = run_tuning(tmp_path / "study.toml", tmp_path / "out")
    assert capsys.readouterr().out.startswith("Tuned for the worst of 'bare', 'loaded'.\n")
    each = [
        fp.evaluate(e, [result.controller], QuadraticCost(1, 0))[0]
        for e in plan.experiments.values()
    ]
    assert result.cost == max(each)
    out = tmp_path / "out"
    assert (out / "loaded-tuned.npz").exists()
    assert not (out / "profile.svg").exists()
    summary = (out / "summary.md").read_text("utf-8")
    assert "## Parameters" in summary
    # One condition, and another law to start from, where the command says so.
    one = run_tuning(
        tmp_path / "study.toml", tmp_path / "one", condition="bare", controller="integer PID"
    )
    bare = plan.experiments["bare"]
    assert one.cost == fp.evaluate(bare, [one.controller], QuadraticCost(1, 0))[0]
    assert (tmp_path / "one" / "integer-pid.npz").exists()
    # The paper's orders are no rivals on another arm, nor marks of its map.
    assert not (out / "loaded-published-orders.npz").exists()


def test_a_stopped_search_is_not_overwritten(tmp_path):
    path = written(tmp_path)
    (tmp_path / "out.checkpoint.npz").write_bytes(b"hours of work")
    with pytest.raises(TuningError, match="resume it, or remove it"):
        run_tuning(path, tmp_path / "out")
    assert (tmp_path / "out.checkpoint.npz").read_bytes() == b"hours of work"
