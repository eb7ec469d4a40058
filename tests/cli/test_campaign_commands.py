"""`fpid-pin campaign` as a person uses it."""

import csv
from pathlib import Path

import pytest

from fpid_pin.campaign import load
from fpid_pin.cli.campaign import read_campaign
from fpid_pin.cli.configuration import demo_config, parse
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ConfigError

SHORT = demo_config().text.replace("duration = 20.0", "duration = 0.2").replace("1e-3", "5e-3", 1)
CAMPAIGN = """
[campaign]
runs = 8
seed = 4
controllers = ["FPID, published orders", "integer PID"]
success = { error = 0.05 }
[campaign.uncertain]
mass = { kind = "uniform", low = 0.8, high = 1.2 }
payload = { kind = "normal", mean = 0.5, std = 0.3 }
delay = { kind = "choices", values = [0, 1, 2] }
disturbance_amplitude = { kind = "log_uniform", low = 0.1, high = 2.0, shared = true }
"""


@pytest.fixture
def config(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "short.toml"
    path.write_text(SHORT + CAMPAIGN)
    return path


def test_run_resume_and_export(config, capsys):
    assert main(["campaign", "run", str(config), "--runs", "3"]) == 0
    said = capsys.readouterr()
    assert "3 plants" in said.out
    assert "integer PID" in said.out
    assert said.out.startswith("Best, by its median RMS error of the last half: ")
    assert "Success (RMS error of the last half at most 50 mrad" in said.out
    head = next(line for line in said.out.splitlines() if line.startswith("controller "))
    assert head.split()[:4] == ["controller", "[%]", "[mrad]", "[N"]
    assert "dynamics compiled" in said.err
    ledger = "runs/short-campaign.sqlite"
    assert main(["campaign", "resume", ledger, "--runs", "8", "--chunk", "2"]) == 0
    assert main(["campaign", "export", ledger, "--out", "a.csv"]) == 0
    rows = list(csv.DictReader(Path("a.csv").read_text().splitlines()))
    assert len(rows) == 16
    assert rows[0]["controller"] == "FPID, published orders"


def test_replay_shows_a_run_beside_its_nominal_twin(config, capsys):
    assert main(["campaign", "run", str(config), "--runs", "4", "--out", "l.sqlite"]) == 0
    arguments = ["replay", "l.sqlite", "--run", "3", "--controller", "integer PID"]
    assert main(["campaign", *arguments, "--html", "page.html"]) == 0
    said = capsys.readouterr().out
    assert "the same bits" in said
    assert "payload:" in said
    page = (config.parent / "page.html").read_text("utf-8")
    assert "run 3, integer PID" in page
    assert "nominal plant" in page
    assert main(["campaign", "replay", "l.sqlite", "--run", "5"]) == 2
    assert capsys.readouterr().err == "fpid-pin: run: expected one that is recorded, got 5\n"


def test_attack_ends_with_the_command_that_shows_it(config, capsys):
    arguments = ["attack", str(config), "--population", "5", "--generations", "1"]
    assert main(["campaign", *arguments, "--out", "a.sqlite"]) == 0
    said = capsys.readouterr().out
    assert 'fpid-pin campaign replay a.sqlite --run 1 --controller "integer PID"' in said
    assert main(["campaign", "replay", "a.sqlite", "--run", "1"]) == 0
    assert main(["campaign", *arguments, "--out", "a.sqlite"]) == 2
    assert "a new file" in capsys.readouterr().err


def test_the_table_is_the_study(tmp_path):
    for dynamics, runs in (("compiled", 8), ("pinocchio", 1000)):
        table = CAMPAIGN if runs == 8 else CAMPAIGN.replace("runs = 8", 'dynamics = "pinocchio"')
        study, planned = read_campaign(parse(SHORT + table, "x", tmp_path))
        assert (study.experiment.dynamics, planned) == (dynamics, runs)
        assert tuple(study.controllers) == ("FPID, published orders", "integer PID")
        assert study.scenarios.seed == 4


def test_every_fault_of_the_table_is_a_line_with_its_key(tmp_path):
    wrong = """
[campaign]
runs = 0
sead = 4
dynamics = "fast"
controllers = ["nobody"]
success = { eror = 0.05 }
[campaign.uncertain]
mass = { kind = "uniform", low = -0.8, high = 1.2 }
paylod = { kind = "uniform", low = 0.0, high = 1.0 }
delay = { kind = "choises", values = [0] }
q0 = { kind = "uniform", low = 0.0 }
"""
    with pytest.raises(ConfigError) as caught:
        read_campaign(parse(SHORT + wrong, "bad.toml", tmp_path))
    lines = str(caught.value).splitlines()
    for words in (
        "campaign.runs: expected a whole number >= 1, got 0",
        "campaign.sead: expected one of",
        "campaign.dynamics: expected one of",
        "campaign.controllers.0: expected one of",
        "campaign.uncertain.mass.low: expected a number > 0, got -0.8",
        "(did you mean payload?)",
        "campaign.uncertain.delay.kind",
        "campaign.uncertain.q0.high: expected a value, got none",
        "campaign.success.eror: expected one of the keys error, peak_torque",
    ):
        assert sum(words in line for line in lines) == 1, words
    assert all(line.startswith("bad.toml: campaign.") for line in lines)
    with pytest.raises(ConfigError, match=r"campaign\.uncertain: expected a table, got none"):
        read_campaign(parse(SHORT, "bad.toml", tmp_path))


def test_another_criterion_is_another_answer_of_the_same_runs(config, capsys):
    runs = ["campaign", "run", str(config), "--runs", "3", "--out", "l.sqlite"]
    assert main(runs) == 0
    config.write_text(config.read_text().replace("error = 0.05", "error = 10.0, at_limits = true"))
    capsys.readouterr()
    assert main(runs) == 0
    assert "at most 10000 mrad): " in capsys.readouterr().out
    data = load("l.sqlite")
    assert data.criterion.error == 10.0
    assert data.success.all()
