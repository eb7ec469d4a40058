"""Killed, interrupted and run twice at once, a search or a campaign is as never disturbed."""

import contextlib
import os
import random
import re
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from bounded import FULL, started, wait_until

import fpid_pin as fp
from fpid_pin.campaign import export, load
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main

pytestmark = pytest.mark.torture
SHORT = demo_config().text.replace("duration = 20.0", "duration = 0.1").replace("1e-3", "5e-3", 1)
LONGER = SHORT.replace("duration = 0.1", f"duration = {2.0 if FULL else 0.5}")
TUNE = """
[tune]
population = 6
generations = 6
seeds = [0, 1]
map_points = 0
[tune.space]
integral_order = [0, 1]
kp = [1, 100, "log"]
"""
CAMPAIGN = """
[campaign]
seed = 2
controllers = ["FPID, published orders", "integer PID"]
[campaign.uncertain]
mass = { kind = "uniform", low = 0.8, high = 1.2 }
payload = { kind = "uniform", low = 0.0, high = 1.0 }
position_noise = { kind = "log_uniform", low = 1e-5, high = 1e-3 }
"""
RESULTS = {"tuned.npz", "history.csv", "summary.md", "report.html", "tuned.toml", "checkpoint.npz"}


@contextlib.contextmanager
def start(folder, *arguments):
    """Start a command for the length of a block, which begins where the command does."""
    # "begun" is told where the command line has been started, and has loaded nothing else yet.
    code = (
        "import sys; from fpid_pin.cli import main; before = main._run; "
        "main._run = lambda words: sys.stderr.write('begun\\n') and before(words); "
        "main.program()"
    )
    with started(
        [sys.executable, "-c", code, *arguments], stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE, text=True, cwd=folder, start_new_session=True,
    ) as child:  # fmt: skip
        assert child.stderr.readline() == "begun\n"
        yield child


def end_of(child):
    said = child.communicate()[1]
    return child.returncode, said


def outcome_of(folder, *arguments):
    """Run a command to its end; return its status and what it said."""
    with start(folder, *arguments) as child:
        return end_of(child)


def holds(folder):
    """Return whether somebody is at work in a folder: then a lock is in it."""
    return any(folder.glob(".fpid_pin-*.lock"))


def visible(folder):
    return {path.name for path in folder.iterdir() if not path.name.startswith(".fpid_pin-")}


def bits_of_search(folder):
    run = fp.Run.load(folder / "out" / "tuned.npz")
    text = (folder / "out" / "history.csv").read_text()
    return text, run.q.tobytes(), str(run.controller.kp)


def damage_of_search(folder):
    """Return what is wrong with what a search has left in its folder at any moment."""
    out = folder / "out"
    if out.exists():
        missing = RESULTS - {path.name for path in out.iterdir()}
        if missing:
            return f"missing {sorted(missing)}"
        bits_of_search(folder)
    for checkpoint in (folder / "out.checkpoint.npz", out / "checkpoint.npz"):
        if checkpoint.exists():
            with np.load(checkpoint) as file:
                assert str(file["meta"])
    return ""


def table_of_campaign(folder):
    return export(load(folder / "l.sqlite"), folder / "table.csv").read_bytes()


def rows_of_campaign(folder, mode="ro"):
    """Return how many rows a sound ledger has; none before it is there, or laid out."""
    try:
        place = f"file:{folder / 'l.sqlite'}?mode={mode}"
        with contextlib.closing(sqlite3.connect(place, uri=True)) as file:
            assert file.execute("PRAGMA integrity_check").fetchone() == ("ok",)
            return file.execute("SELECT count(*) FROM results").fetchone()[0]
    except sqlite3.OperationalError:  # not there yet, or not laid out
        return 0


def damage_of_campaign(folder):
    rows = rows_of_campaign(folder, "rw")
    return "" if rows % 16 == 0 else f"{rows} rows, a part of a chunk"


class Work(NamedTuple):
    """What is killed, and gone on with by the same words."""

    text: str
    words: tuple[str, ...]
    kills: int  # in full
    begun: Callable[..., Any]  # whether there is something to go on from
    damage: Callable[..., str]  # of what is there at any moment
    result: Callable[..., Any]  # the bits of what is there at the end
    leaves: set[str]


CAMPAIGN_WORDS = ("campaign", "run", "study.toml", "--out", "l.sqlite", "--chunk", "8", "--runs")
WORK = {
    "tune": Work(
        SHORT + TUNE, ("tune", "study.toml", "--out", "out", "--resume"), 100,
        lambda folder: (folder / "out.checkpoint.npz").exists(), damage_of_search, bits_of_search,
        {"study.toml", "out"},
    ),
    "campaign": Work(
        LONGER + CAMPAIGN, (*CAMPAIGN_WORDS, "600" if FULL else "200"), 20, rows_of_campaign,
        damage_of_campaign, table_of_campaign, {"study.toml", "l.sqlite"},
    ),
}  # fmt: skip


def study(folder, text=WORK["tune"].text):
    folder.mkdir()
    (folder / "study.toml").write_text(text)
    return folder


@pytest.fixture(scope="module", params=WORK)
def never(request, tmp_path_factory):
    """Return the name of some work, its bits where nobody disturbs it, and how long it took [s]."""
    work = WORK[request.param]
    folder = study(tmp_path_factory.mktemp("never") / "own", work.text)
    began = time.monotonic()
    if FULL:  # how long a process takes
        status, said = outcome_of(folder, *work.words)
        assert status == 0, said
    else:
        with contextlib.chdir(folder):
            assert main(list(work.words)) == 0
    return request.param, work.result(folder), time.monotonic() - began


def test_killed_at_any_moment_and_resumed(never, tmp_path, tally):
    name, bits, seconds = never
    work = WORK[name]
    chance, kills, round_, midway = random.Random(6), 0, 0, 0
    most = work.kills if FULL else 1
    while kills < most:
        folder = study(tmp_path / str(round_), work.text)
        options = ("--workers", "2") if round_ % 2 else ()
        round_ += 1
        status = None
        while status != 0:
            with start(folder, *work.words, *options) as child:
                if kills == 0:
                    assert wait_until(lambda folder=folder: work.begun(folder))
                elif kills < most:
                    time.sleep(chance.uniform(0.2, 1.1) * seconds)
                if kills < most:
                    child.kill()
                status, said = end_of(child)
            if status == 0:
                break
            assert status == -signal.SIGKILL, said
            kills += 1
            tally(f"SIGKILL over {name}", work.damage(folder))
            midway += bool(work.begun(folder))
        left = visible(folder)
        tally("what is left", "" if left == work.leaves else f"{sorted(left)}")
        tally(f"{name}, then resumed", "" if work.result(folder) == bits else "other bits")
    assert midway > 0


@pytest.mark.parametrize("never", ["tune"], indirect=True)
def test_two_at_once_on_one_folder(never, tmp_path, tally):
    _, bits, seconds = never
    chance = random.Random(7)
    for k in range(10 if FULL else 1):
        folder = study(tmp_path / str(k))
        with start(folder, "tune", "study.toml", "--out", "out") as first:
            if k == 0:
                # The first is at work, and stays so until the second has ended.
                assert wait_until(lambda folder=folder: holds(folder))
                first.send_signal(signal.SIGSTOP)
            else:
                time.sleep(chance.uniform(0.0, 0.3) * seconds)
            ends = [outcome_of(folder, "tune", "study.toml", "--out", "out", "--resume")]
            first.send_signal(signal.SIGCONT)
            ends = sorted([*ends, end_of(first)])
        fault = ""
        if [status for status, _ in ends] != [0, 2]:
            fault = f"{ends}"
        elif not re.fullmatch(r".*another fpid-pin at work there.*\n", ends[1][1]):
            fault = ends[1][1]
        elif bits_of_search(folder) != bits or visible(folder) != {"study.toml", "out"}:
            fault = f"other bits, or {visible(folder)}"
        tally("two tune on one folder", fault or damage_of_search(folder))


COMMANDS = {
    "run": ("run", "study.toml", "--controller", "integer PID", "--out", "out"),
    "tune": ("tune", "study.toml", "--out", "out"),
    "tune, two workers": ("tune", "study.toml", "--out", "out", "--workers", "2"),
    "compare": ("compare", "study.toml", "--out", "out"),
    "operators": ("operators", "--order", "0.5", "--plot", "out.png"),
    "arms": ("arms",),
}


@pytest.mark.parametrize("name", COMMANDS if FULL else ["run", "tune, two workers"])
def test_ctrl_c_at_any_moment(name, tmp_path, tally):
    chance, seconds = random.Random(name), 1.0
    for k in range(25 if FULL else 2):
        folder = study(tmp_path / str(k))
        with start(folder, *COMMANDS[name]) as child:
            began = time.monotonic()
            time.sleep(chance.uniform(0.0, 1.1) * seconds)
            # As a terminal does it: to the workers too.
            os.killpg(os.getpgid(child.pid), signal.SIGINT)
            status, said = end_of(child)
        if status == 0:
            seconds = max(0.5, 0.8 * (time.monotonic() - began))
        else:
            seconds = min(seconds * 1.3, 20.0)
        fault = damage_of_search(folder) if "tune" in name else ""
        if status not in (0, 130) or "Traceback" in said or "Exception" in said:
            fault = f"status {status}: {said}"
        elif status == 0 and name in ("run", "tune", "compare") and not (folder / "out").exists():
            fault = "no results"
        elif status == 130 and "fpid-pin: stopped" not in said:
            fault = f"not told: {said}"
        left = {path.name for path in folder.iterdir()}
        if left - {"study.toml", "out", "out.checkpoint.npz", "out.png"}:
            fault = f"left {sorted(left)}"
        tally(f"Ctrl-C over {name}", fault)
