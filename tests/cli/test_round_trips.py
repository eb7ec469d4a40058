"""What a command writes the next one reads, also from another folder and with own code."""

import dataclasses
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.cli.configuration import demo_config, load, parse
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.toml import toml_text
from fpid_pin.view.document import asset

URDF = Path(__file__).parents[2] / "urdf" / "two_link.urdf"
OWN = """
from dataclasses import dataclass
import fpid_pin as fp

@fp.described("trip_law")
@dataclass(frozen=True, eq=False)
class TripLaw(fp.Controller):
    kp: float = 30.0
    kd: float = 6.0

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.e_dot
"""
MINE = """
[[controller]]
name = "mine"
kind = "trip_law"
[[condition]]
name = "as it is"
[[condition]]
name = "1 kg"
plant = { payload = { mass = 1.0 } }
[tune]
population = 4
generations = 1
map_points = 0
profile_points = 0
[tune.space]
kp = [10.0, 60.0]
[campaign]
runs = 3
[campaign.uncertain]
payload = { kind = "uniform", low = 0.0, high = 1.0 }
"""
ALLOWED = "--allow-import"


def saved_by(page):
    """Return the TOML that a playground's page gives."""
    if shutil.which("node") is None:
        pytest.skip("no node")
    text = Path(page).read_text("utf-8")
    tables = re.findall(r"<script>(const (?:ENGINE|PAGE) = \{.*?\};)</script>", text)
    settings = asset("playground_settings.js").replace('"use strict";', "", 1)
    ask = "process.stdout.write(toToml(settingsOf(PAGE.start, 0)));"
    Path("page.js").write_text("\n".join([*tables, settings, ask]), encoding="utf-8")
    done = finished(["node", "page.js"])
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.filterwarnings("ignore::fpid_pin.FpidWarning")
def test_the_whole_way_with_a_robot_s_file_and_own_code_beside_the_configuration(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    study = Path("study")
    study.mkdir()
    robot = URDF.read_text().replace('effort="0" velocity="0"', 'effort="90" velocity="9"')
    (study / "arm.urdf").write_text(robot)
    (study / "trip_law.py").write_text(OWN)

    def does(*words):
        assert main([*words]) == 0, capsys.readouterr().err

    does("init", "study/arm.urdf", "--out", "study/arm.toml")
    text = (study / "arm.toml").read_text().replace("duration = 10.0", "duration = 0.05")
    text = text.replace("format = 1", 'format = 1\nimport = "trip_law.py"')
    head, *laws = re.sub(r"\[\[condition\]\].*", "", text, flags=re.S).split("[[controller]]")
    (study / "arm.toml").write_text("[[controller]]".join([head, laws[-1]]) + MINE)
    does("compare", "study/arm.toml", ALLOWED, "--no-figures")
    does("run", "study/arm.toml", ALLOWED, "--controller", "mine", "--no-figures")
    whole, alone = Path("runs/arm"), Path("runs/arm-run-mine")
    run = fp.Run.load(alone / "mine.npz")
    assert np.array_equal(run.q, fp.Run.load(whole / "as-it-is-mine.npz").q)
    # The copy beside results is of the same arm and law, wherever it lies; so are its results.
    assert "# around home, within" in (whole / "config.toml").read_text()
    does("run", "runs/arm/config.toml", ALLOWED, "--controller", "mine", "--no-figures")
    assert np.array_equal(run.q, fp.Run.load("runs/arm-config-run-mine/mine.npz").q)

    does("tune", "study/arm.toml", ALLOWED, "--controller", "mine")
    tuned = "runs/arm-tuned/tuned.toml"
    does("compare", tuned, ALLOWED, "--no-figures")
    does("run", tuned, ALLOWED, "--controller", "tuned", "--condition", "1 kg", "--no-figures")
    found = fp.Run.load("runs/arm-tuned-tuned-run-tuned-1-kg/tuned.npz")
    assert np.array_equal(found.q, fp.Run.load("runs/arm-tuned/1-kg-tuned.npz").q)
    does("playground", tuned, ALLOWED, "--html", "page.html")
    (study / "saved.toml").write_text(saved_by("page.html"))
    does("run", "study/saved.toml", ALLOWED, "--no-figures")
    played = fp.Run.load("runs/saved-run-tuned/tuned.npz")
    assert np.array_equal(played.q, fp.Run.load("runs/arm-tuned/as-it-is-tuned.npz").q)

    does("campaign", "run", "study/arm.toml", ALLOWED, "--out", "deep/ledger.sqlite")
    does("campaign", "resume", "deep/ledger.sqlite", "--runs", "4", ALLOWED)
    does("campaign", "report", "deep/ledger.sqlite", ALLOWED, "--no-replays")
    does("campaign", "replay", "deep/ledger.sqlite", "--run", "3", "--save", "again.npz", ALLOWED)
    again = fp.campaign.replay("deep/ledger.sqlite", 3)
    assert again.exact
    assert np.array_equal(again.run.q, fp.Run.load("again.npz").q)
    does("view", "again.npz", "--html", "again.html")

    does("export", tuned, "--controller", "tuned", "--out", "c", ALLOWED, "--ticks", "20")
    does("run", "c/controller.toml", ALLOWED, "--controller", "tuned", "--no-figures")
    assert np.array_equal(fp.Run.load("runs/controller-run-tuned/tuned.npz").q, played.q)


def test_a_tuned_file_is_one_to_read(tmp_path):
    """Names, comments, lists on a line, and what the law was tuned against."""
    text = demo_config().text.replace("duration = 20.0", "duration = 0.05")
    tune = MINE.partition("[tune]")[2].partition("[campaign]")[0]
    (tmp_path / "study.toml").write_text(f"{text}\n[tune]{tune}")
    out = tmp_path / "out"
    assert main(["tune", str(tmp_path / "study.toml"), "--out", str(out)]) == 0
    tuned = (out / "tuned.toml").read_text()
    assert list(load(out / "tuned.toml").controllers) == [
        "tuned", "FPID, published orders", "integer orders",
    ]  # fmt: skip
    assert tuned.startswith("# Found by `fpid-pin tune ")
    assert "--controller tuned\n" in tuned
    assert "[[controller]]  # searched: kp\n" in tuned
    assert re.search(r"^kp = \[[\d., ]+\]  # \[N m/rad\]$", tuned, re.M)
    assert not re.search(r"\[\n +[-\d.]", tuned)


@dataclasses.dataclass(frozen=True, eq=False)
class Nameless(fp.Controller):
    kp: float = 1.0

    @staticmethod
    def torque(c):
        return c.kp * c.e


def test_to_toml_writes_what_load_reads():
    experiment, laws = fp.paper_experiment(duration=0.1), [fp.paper_controller(), fp.Pid(9.0, 1, 1)]
    read = parse(fp.to_toml(experiment, laws, title='a "b"'), "x", Path())
    assert read.title == 'a "b"'
    assert list(read.controllers) == ["FPID, published orders", "PID"]
    assert descriptions.to_dict(read.experiment) == descriptions.to_dict(experiment)
    for run, twin in zip(
        fp.simulate(experiment, laws),
        fp.simulate(read.experiment, list(read.controllers.values())),
        strict=True,
    ):
        assert np.array_equal(run.torque, twin.torque)


def test_to_toml_has_conditions_and_says_what_it_cannot_write():
    plain = fp.paper_experiment(duration=0.1)
    loaded = dataclasses.replace(
        plain,
        plant=fp.Plant(arm=plain.arm.with_payload(1.0), viscous_friction=(1.0, 0.5)),
        sensors=fp.Sensors(delay=2),
    )
    written = fp.to_toml({"plain": plain, "loaded": loaded}, {"mine": fp.paper_controller()})
    read = parse(written, "x", Path())
    assert list(read.controllers) == ["mine"]
    for name, experiment in (("plain", plain), ("loaded", loaded)):
        told = descriptions.to_dict(read.conditions[name])
        assert told == descriptions.to_dict(experiment)
    with pytest.raises(ArgumentError, match="plant and sensors only, got longer"):
        fp.to_toml({"plain": plain, "longer": fp.paper_experiment()}, fp.paper_controller())
    with pytest.raises(ArgumentError, match="classes named by fpid_pin.described, got Nameless"):
        fp.to_toml(plain, Nameless())
    with pytest.raises(ArgumentError, match="a name of its own each"):
        fp.to_toml(plain, [fp.paper_controller()] * 2)


@pytest.mark.parametrize("quote", ['"', "'"])
def test_paths_follow_their_file_and_comments_stay(tmp_path, quote):
    (tmp_path / "arm.urdf").write_text(URDF.read_text().replace('effort="0" velocity="0"', ""))
    table = f"kind = \"urdf\"\npath = {quote}arm.urdf{quote}\npackage_dirs = ['meshes']"
    text = demo_config().text.replace('kind = "two_link"', table)
    (tmp_path / "c.toml").write_text(text)
    written = load(tmp_path / "c.toml").at(tmp_path / "deep" / "out").text
    assert written == text.replace(f"{quote}arm.urdf{quote}", '"../../arm.urdf"').replace(
        "'meshes'", '"../../meshes"'
    )
    # A name that is a path's, too: it stays, and comments go.
    odd = text.replace('"integer PID"', '"arm.urdf"').replace("'arm.urdf'", '"arm.urdf"')
    (tmp_path / "c.toml").write_text(odd)
    again = tomllib.loads(load(tmp_path / "c.toml").at(tmp_path / "out").text)
    assert again["controller"][-1]["name"] == "arm.urdf"
    assert again["arm"]["path"] == "../arm.urdf"


def test_lists_of_lists_of_tables_and_of_odd_texts_are_written_as_they_are():
    table = {"a": [[1, 2], [3.5]], "b": [[{"c": [1, 2]}, {"d": 2}]], "e": [], "s": ['x,\n["]', "["]}
    assert tomllib.loads(toml_text(table)) == table
