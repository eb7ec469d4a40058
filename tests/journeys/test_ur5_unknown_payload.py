"""An afternoon with a UR5 and a payload that nobody told of: eight commands, 25 lines of TOML."""

import csv
import re
import shutil
from pathlib import Path

import numpy as np
from PIL import Image

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


COMMANDS = """compare config.toml --out compared --png
tune config.toml --out tuned
run tuned/tuned.toml --controller tuned --out run --no-figures
view run/tuned.npz --html run.html
export tuned/tuned.toml --controller tuned --out c --horizon 60 --ticks 50"""


def test_an_afternoon_takes_eight_commands_and_25_lines(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands = ["inspect ur5", "init ur5", *COMMANDS.splitlines()]
    compiler = shutil.which("gcc") or shutil.which("cc")
    assert len(commands) <= 8
    assert len(WRITTEN.strip().splitlines()) <= 25
    for words in commands if compiler else commands[:-1]:
        assert main(words.split()) == 0, words
        if words.startswith("init"):
            short = 'duration = 0.5\ndynamics = "compiled"'
            text = Path("config.toml").read_text("utf-8").replace("duration = 10.0", short)
            text = re.sub(
                r"\[\[condition\]\].*", "[[condition]]\nname = 'nominal'\n", text, flags=re.S
            )
            Path("config.toml").write_text(text + WRITTEN, encoding="utf-8")
    with open("tuned/history.csv", newline="", encoding="utf-8") as file:
        costs = [float(row["best cost"]) for row in csv.DictReader(file)]
    assert costs[-1] <= costs[0]
    summary = Path("tuned/summary.md").read_text("utf-8")
    assert re.search(r"less than the start|was not improved on", summary)
    run = fp.Run.load("run/tuned.npz")
    assert run.outcome.completed
    assert run.arm.name == "ur5"
    assert not re.search(r'(src|href)="https?:', Path("run.html").read_text("utf-8"))
    if compiler:
        assert "torques equal to the last bit" in Path("c/README.md").read_text("utf-8")
    pictures = sorted(Path("compared").glob("comparison-*.png"))
    assert len(pictures) == 2
    for path in pictures:
        every_controller_has_a_colour(path)


def every_controller_has_a_colour(path):
    """Check that curves of each colour are drawn, over half of the picture at least: no slivers."""
    image = np.asarray(Image.open(path).convert("RGB"), dtype=np.int64)
    drawn = np.zeros(image.shape[:2], dtype=bool)
    for colour in PALETTE[:4]:
        want = np.array([int(colour[k : k + 2], 16) for k in (1, 3, 5)])
        # To within what smoothing does to thin lines.
        here = np.abs(image - want).max(axis=2) < 24
        assert here.sum() > 100, (path, colour)
        drawn |= here
    down, across = np.nonzero(drawn)
    assert np.ptp(down) > 0.5 * image.shape[0]
    assert np.ptp(across) > 0.6 * image.shape[1]
