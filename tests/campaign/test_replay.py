import csv

import numpy as np
import pytest
from studies import Faulty, bits, pushed, study

import fpid_pin as fp
from fpid_pin.campaign import (
    Normal,
    Scenarios,
    Study,
    Uniform,
    attack,
    export,
    load,
    replay,
    report_html,
    run,
)  # fmt: skip
from fpid_pin.campaign.data import METRICS
from fpid_pin.exceptions import ArgumentError, FileFormatError, SimulationError


@pytest.fixture(scope="module")
def ledger(tmp_path_factory):
    path = tmp_path_factory.mktemp("replay") / "ledger.sqlite"
    run(study(), path, 6, chunk=4)
    return path


@pytest.mark.parametrize(("number", "controller"), [(0, None), (5, "integer")])
def test_a_replay_has_the_bits_of_its_row(ledger, number, controller):
    again = replay(ledger, number, controller)
    assert again.exact
    data = load(ledger)
    column = data.controllers.index(again.controller)
    now = dict(zip(METRICS, again.again.figures, strict=True))
    for name, values in data.metrics.items():
        assert now[name] == values[number, column]
    assert list(again.sample.values()) == data.samples[number].tolist()
    assert "kp" in again.run.signals
    assert len(again.run.t) == 101
    twin = fp.simulate(study().experiment, study().controllers[again.controller])
    assert again.nominal.q.tobytes() == twin.q.tobytes()
    assert again.run.q.tobytes() != twin.q.tobytes()


def test_ledger_export_report_and_replay_say_the_dynamics(tmp_path):
    told = "pinocchio"
    made = study(duration=0.1, dynamics=told)
    data = run(made, tmp_path / "l.sqlite", 3)
    assert data.dynamics == load(tmp_path / "l.sqlite").dynamics == told
    with open(export(data, tmp_path / "l.csv"), newline="") as file:
        assert {row["dynamics"] for row in csv.DictReader(file)} == {told}
    page = report_html(data, tmp_path / "l.html").read_text(encoding="utf-8")
    assert f"Dynamics: {told}." in page
    again = replay(tmp_path / "l.sqlite", 2)
    assert again.exact
    assert again.run.meta["experiment"]["dynamics"] == told
    # The two agree within rounding, and are told apart.
    other = study(duration=0.1, dynamics=None)
    with pytest.raises(FileFormatError, match=r"another: experiment\.dynamics is "):
        run(other, tmp_path / "l.sqlite", 3)
    beside = run(other, tmp_path / "other.sqlite", 3)
    assert beside.dynamics == "compiled"
    assert beside.metrics["rms"] == pytest.approx(data.metrics["rms"], rel=1e-9)


def test_what_is_not_there_is_refused_and_a_run_that_failed_has_nothing_to_show(ledger, tmp_path):
    with pytest.raises(ArgumentError, match="run: expected one that is recorded, got 6"):
        replay(ledger, 6)
    with pytest.raises(ArgumentError, match="did you mean integer"):
        replay(ledger, 0, "intege")
    made = pushed(Faulty(amplitude=0.5))
    data = run(made, tmp_path / "l.sqlite", 16)
    bad = int(np.flatnonzero(data.outcome[:, 0] == "failed")[0])
    with pytest.raises(SimulationError, match="a fault of its own; there is nothing to replay"):
        replay(tmp_path / "l.sqlite", bad)


def test_an_attack_finds_the_corner_that_sampling_misses(tmp_path):
    # PD without enough gravity compensation: the heaviest payload is the worst, whatever else.
    spreads = {
        "payload": Uniform(low=0.0, high=3.0),
        "viscous_friction": Uniform(low=0.0, high=0.1, shared=True),
        "position_noise": Normal(mean=1e-4, std=1e-5, shared=True),
    }
    experiment = fp.Experiment(
        fp.Arm.two_link(), fp.references.Hold((0.2, 0.3)), duration=1.0, step=5e-3
    )
    laws = {"soft": fp.PdGravity(kp=60.0, kd=15.0), "stiff": fp.PdGravity(kp=300.0, kd=30.0)}
    made = Study(experiment, laws, Scenarios(spreads, seed=1), "hold")
    ledger = tmp_path / "worst.sqlite"
    worst = attack(made, ledger, population=12, generations=12, workers=2)
    sampled = run(made, tmp_path / "sampled.sqlite", 64)
    alone = attack(made, tmp_path / "alone.sqlite", population=12, generations=12)
    assert bits(alone) == bits(worst)
    column = worst.parameters.index("payload")
    assert worst.samples[:, column] == pytest.approx(3.0, abs=0.05)
    for k in range(2):
        assert worst.metrics["rms"][k, k] > sampled.metrics["rms"][:, k].max()
        again = replay(ledger, k, worst.controllers[k])
        assert again.exact
        assert again.again.figures[0] == worst.metrics["rms"][k, k]
    with pytest.raises(ArgumentError, match="population"):
        attack(made, tmp_path / "x.sqlite", population=2)
