"""Killed, interrupted and run twice at once, a search loses nothing and is as never disturbed."""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from bounded import started, wait_until

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main

pytestmark = pytest.mark.torture
FULL = os.environ.get("FPID_TORTURE") == "full"
SHORT = demo_config().text.replace("duration = 20.0", "duration = 0.1").replace("1e-3", "5e-3", 1)
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


def bits_of(out):
    run = fp.Run.load(out / "tuned.npz")
    return (out / "history.csv").read_text(), run.q.tobytes(), str(run.controller.kp)


def damage_of(folder):
    """Return what is wrong with what a search has left in its folder at any moment."""
    out = folder / "out"
    if out.exists():
        missing = RESULTS - {path.name for path in out.iterdir()}
        if missing:
            return f"missing {sorted(missing)}"
        bits_of(out)
    beside = folder / "out.checkpoint.npz"
    for checkpoint in (beside, out / "checkpoint.npz"):
        if checkpoint.exists():
            with np.load(checkpoint) as file:
                assert str(file["meta"])
    return ""


@pytest.fixture(scope="module")
def never(tmp_path_factory):
    """Return the bits of a search that nobody disturbed, and how long it took [s]."""
    folder = tmp_path_factory.mktemp("never")
    (folder / "study.toml").write_text(SHORT + TUNE)
    began = time.monotonic()
    if FULL:  # how long a process takes
        status, said = outcome_of(folder, "tune", "study.toml", "--out", "out")
        assert status == 0, said
    else:
        assert main(["tune", str(folder / "study.toml"), "--out", str(folder / "out")]) == 0
    return bits_of(folder / "out"), time.monotonic() - began


def test_killed_at_any_moment_and_resumed(never, tmp_path, tally, full):
    bits, seconds = never
    chance, kills, round_, resumed = random.Random(6), 0, 0, 0
    most = 100 if full else 1
    while kills < most:
        folder = tmp_path / str(round_)
        folder.mkdir()
        (folder / "study.toml").write_text(SHORT + TUNE)
        round_ += 1
        status = None
        while status != 0:
            with start(folder, "tune", "study.toml", "--out", "out", "--resume") as child:
                if kills == 0:
                    # Once there is something to go on from.
                    beside = folder / "out.checkpoint.npz"
                    assert wait_until(beside.exists)
                elif kills < most:
                    time.sleep(chance.uniform(0.3, 1.1) * seconds)
                else:
                    child.wait()
                child.kill()
                status, said = end_of(child)
            if status == 0:
                break
            assert status == -signal.SIGKILL, said
            kills += 1
            tally("SIGKILL over tune", damage_of(folder))
            resumed += (folder / "out.checkpoint.npz").exists()
        tally("and then resumed", "" if bits_of(folder / "out") == bits else "other bits")
        left = visible(folder)
        tally("what is left", "" if left == {"study.toml", "out"} else f"{sorted(left)}")
    assert resumed > 0


def test_two_at_once_on_one_folder(never, tmp_path, tally, full):
    bits, seconds = never
    chance = random.Random(7)
    for k in range(10 if full else 1):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "study.toml").write_text(SHORT + TUNE)
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
        elif (
            len(ends[1][1].splitlines()) != 1 or "another fpid-pin at work there" not in ends[1][1]
        ):
            fault = ends[1][1]
        elif bits_of(folder / "out") != bits or visible(folder) != {"study.toml", "out"}:
            fault = f"other bits, or {visible(folder)}"
        tally("two tune on one folder", fault or damage_of(folder))


COMMANDS = {
    "run": ("run", "study.toml", "--controller", "integer PID", "--out", "out"),
    "tune": ("tune", "study.toml", "--out", "out"),
    "tune, two workers": ("tune", "study.toml", "--out", "out", "--workers", "2"),
    "compare": ("compare", "study.toml", "--out", "out"),
    "operators": ("operators", "--order", "0.5", "--plot", "out.png"),
    "arms": ("arms",),
}


@pytest.mark.parametrize("name", COMMANDS if FULL else ["run", "tune, two workers"])
def test_ctrl_c_at_any_moment(name, tmp_path, tally, full):
    chance, seconds = random.Random(name), 1.0
    for k in range(25 if full else 2):
        folder = tmp_path / str(k)
        folder.mkdir()
        (folder / "study.toml").write_text(SHORT + TUNE)
        with start(folder, *COMMANDS[name]) as child:
            began = time.monotonic()
            time.sleep(chance.uniform(0.0, 1.1) * seconds)
            # As a terminal does it: to the workers too.
            with_workers = os.getpgid(child.pid)
            os.killpg(with_workers, signal.SIGINT)
            status, said = end_of(child)
        if status == 0:
            seconds = max(0.5, 0.8 * (time.monotonic() - began))
        else:
            seconds = min(seconds * 1.3, 20.0)
        fault = damage_of(folder) if "tune" in name else ""
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
