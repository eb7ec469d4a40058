"""An afternoon with a UR5 and a payload that nobody told of: eight commands, 25 lines of TOML."""

import csv
import re
import shutil

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.cli.main import main
from fpid_pin.view.style import PALETTE

#: All that is written by hand: a short run, one condition, what to search.
WRITTEN = """
[[condition]]
name = "payload 3 kg"
plant = { payload = { mass = 3.0 } }

[tune]
controller = "FPID"
population = 4
generations = 1
map_points = 0
profile_points = 0
[tune.space]
bandwidth = [4.0, 12.0, "shared"]
derivative_order = [0.6, 0.98, "shared"]
"""


@pytest.fixture(scope="module")
def afternoon(tmp_path_factory):
    """Go through it once; the commands' statuses and the folder."""
    folder = tmp_path_factory.mktemp("afternoon")
    config = folder / "config.toml"
    commands = [["inspect", "ur5"], ["init", "ur5", "--out", str(config)]]
    told = [main(command) for command in commands]
    short = 'duration = 0.5\ndynamics = "compiled"'
    text = config.read_text("utf-8").replace("duration = 10.0", short)
    text = re.sub(r"\[\[condition\]\].*", "[[condition]]\nname = 'nominal'\n", text, flags=re.S)
    config.write_text(text + WRITTEN, encoding="utf-8")
    compared, tuned = folder / "compared", folder / "tuned"
    after = [
        ["compare", str(config), "--out", str(compared), "--png"],
        ["tune", str(config), "--out", str(tuned)],
        [
            "run",
            str(tuned / "tuned.toml"),
            "--controller",
            "tuned",
            "--out",
            str(folder / "run"),
            "--no-figures",
        ],
        ["view", str(folder / "run" / "tuned.npz"), "--html", str(folder / "run.html")],
    ]
    if shutil.which("gcc") or shutil.which("cc"):
        after.append(
            ["export", str(tuned / "tuned.toml"), "--controller", "tuned", "--out",
             str(folder / "c"), "--horizon", "60", "--ticks", "50"]
        )  # fmt: skip
    told += [main(command) for command in after]
    return folder, told, len(commands) + len(after)


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_it_takes_eight_commands_and_25_lines(afternoon):
    _, told, count = afternoon
    assert told == [0] * count
    assert count <= 8
    assert len(WRITTEN.strip().splitlines()) <= 25


def test_the_comparison_has_an_answer_that_its_table_bears_out(afternoon):
    folder, _, _ = afternoon
    summary = (folder / "compared" / "summary.md").read_text("utf-8")
    answer = next(line for line in summary.splitlines() if line.startswith("- Best by condition"))
    table = rows(folder / "compared" / "summary.csv")
    tail = next(head for head in table[0] if head.startswith("tail"))
    for condition in ("nominal", "payload 3 kg"):
        here = [row for row in table if row["condition"] == condition]
        best = min(here, key=lambda row: float(row[tail]))
        assert best["best"] == "best"
        said = next(part for part in answer.split(";") if condition in part)
        assert best["controller"].replace("+", "\\+") in said or best["controller"] in said


def test_the_tuned_law_is_no_worse_than_the_suggested_one_and_runs_as_it_is(afternoon):
    folder, _, _ = afternoon
    costs = [float(row["best cost 0"] if "best cost 0" in row else row["best cost"])
             for row in rows(folder / "tuned" / "history.csv")]  # fmt: skip
    assert costs[-1] <= costs[0]
    summary = (folder / "tuned" / "summary.md").read_text("utf-8")
    assert re.search(r"less than the start|was not improved on", summary)
    assert "## Parameters" in summary
    run = fp.Run.load(folder / "run" / "tuned.npz")
    assert run.outcome.completed
    assert run.arm.name == "ur5"


def pixels(path):
    from PIL import Image

    return np.asarray(Image.open(path).convert("RGB"), dtype=np.int64)


def seen(image, colour):
    """Return how many pixels have a colour, to within what smoothing does to thin lines."""
    want = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
    return int((np.abs(image - want).max(axis=2) < 24).sum())


def test_the_picture_shows_every_controller_in_a_colour_of_its_own(afternoon):
    folder, _, _ = afternoon
    names = sorted((folder / "compared").glob("comparison-*.png"))
    assert len(names) == 2
    for name in names:
        image = pixels(name)
        counts = [seen(image, colour) for colour in PALETTE[:4]]
        assert min(counts) > 100, (name.name, counts)
        # Curves are drawn over half of the picture's height and width at least: no slivers.
        drawn = np.zeros(image.shape[:2], dtype=bool)
        for colour in PALETTE[:4]:
            want = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
            drawn |= np.abs(image - want).max(axis=2) < 24
        down, across = np.nonzero(drawn)
        assert np.ptp(down) > 0.5 * image.shape[0]
        assert np.ptp(across) > 0.6 * image.shape[1]


def test_the_replay_is_one_file_and_the_export_is_checked(afternoon):
    folder, _, count = afternoon
    page = (folder / "run.html").read_text("utf-8")
    assert "http-equiv" in page
    assert not re.search(r'(src|href)="https?:', page)
    if count == 7:
        readme = (folder / "c" / "README.md").read_text("utf-8")
        assert "torques equal to the last bit" in readme
