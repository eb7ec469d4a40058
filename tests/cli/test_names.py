"""Names are shown, files are told apart: no name costs another its file."""

import csv
import tomllib
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config, load
from fpid_pin.cli.main import main
from fpid_pin.cli.output import file_names
from fpid_pin.costs import QuadraticCost
from fpid_pin.descriptions import described

HEAD = demo_config().text.split("[[controller]]")[0].replace("= 20.0", "= 0.05")
PID = '[[controller]]\nkind = "pid"\nname = "{}"\nkp = {}\nki = 0.0\nkd = 10.0\n'


@settings(max_examples=40)
@given(st.lists(st.lists(st.text(max_size=20), min_size=1, max_size=2), max_size=8))
def test_every_label_has_a_file_name_of_its_own_that_any_system_takes(labels):
    names = file_names(labels, taken=["checkpoint"])
    assert len({name.casefold() for name in [*names, "checkpoint"]}) == len(labels) + 1
    for name in names:
        assert name
        assert not set(name) & set('/\\.:*?"<>| \0\n')
        assert len(f"{name}.npz".encode()) <= 255


def test_names_alike_are_numbered():
    labels = ["A b", "a-b", "a-b-2", "PID +", "PID -", "PID", "", "...", "run", "é", "e\u0301"]
    names = [
        "a-b", "a-b-2", "a-b-2-2", "pid", "pid-2", "pid-3", "run", "run-2", "run-3", "é", "é-2"
    ]  # fmt: skip
    assert file_names([[label] for label in labels]) == names
    assert file_names([["checkpoint"]], taken=["checkpoint"]) == ["checkpoint-2"]
    # No longer than a file's may be.
    assert file_names([["xä" * 126, "y"], ["xä" * 126]]) == ["xä" * 73 + "x", "xä" * 73 + "x-2"]


TUNE = """
[tune]
population = 4
generations = 2
map_points = 0
[tune.space]
kp = [20.0, 100.0]
"""


@described("nameless")
@dataclass(frozen=True, eq=False)
class Nameless(fp.Controller):
    """A law of one's own that has no name to give."""

    kp: ArrayLike

    @staticmethod
    def torque(c):
        return c.kp * c.e - 10.0 * c.v


@pytest.mark.parametrize(
    ("law", "label", "file"),
    [
        (PID.format("tuned", 30.0), "tuned, as configured", "tuned-as-configured.npz"),
        ('[[controller]]\nkind = "nameless"\nkp = 30.0\n', "nameless", "nameless.npz"),
    ],
)
@pytest.mark.filterwarnings("ignore:.*of the cost at the start")
def test_a_controller_called_as_a_result_takes_no_result_s_place(tmp_path, law, label, file):
    path, out = tmp_path / "study.toml", tmp_path / "out"
    path.write_text(HEAD + law + TUNE)
    assert main(["tune", str(path), "--out", str(out)]) == 0
    best, _ = tomllib.loads((out / "tuned.toml").read_text())["controller"]
    table = (out / "summary.csv").read_text().splitlines()
    rows = {row["controller"]: row for row in csv.DictReader(table)}
    assert {key: row["file"] for key, row in rows.items()} == {"tuned": "tuned.npz", label: file}
    experiment = load(path).experiment.with_dynamics("compiled")
    text = (out / "summary.md").read_text()
    for key, kp in (("tuned", best["kp"]), (label, 30.0)):
        run = fp.Run.load(out / rows[key]["file"])
        assert np.allclose(run.controller.kp, kp, rtol=1e-15)
        again = fp.simulate(experiment, run.controller)
        assert np.array_equal(again.q, run.q)
        cost = QuadraticCost().of(run.metrics)
        assert float(rows[key]["cost (33)"]) == cost
        assert f"| {key} | {cost:.4g} |" in text.split("## Seeds")[0]
