"""Whatever a disk refuses is one line; older results stay, and nothing half written does."""

import json
import os
import resource
import shutil
import sys
from pathlib import Path

import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config

pytestmark = pytest.mark.torture
HERE = Path(__file__).parent
SHORT = demo_config().text.replace("duration = 20.0", "duration = 0.05")
TUNE = "\n[tune]\npopulation = 4\ngenerations = 2\nmap_points = 0\n[tune.space]\nkp = [1, 100]\n"


@pytest.fixture(scope="module")
def shim(tmp_path_factory):
    if shutil.which("gcc") is None or sys.platform != "linux":
        pytest.skip("needs gcc, on Linux")
    path = tmp_path_factory.mktemp("shim") / "fault.so"
    finished(["gcc", "-shared", "-fPIC", "-O1", "-o", path, HERE / "fault.c", "-ldl"], check=True)
    return path


def written(folder):
    (folder / "short.toml").write_text(SHORT + TUNE)
    fp.simulate(fp.paper_experiment(duration=0.05), fp.paper_controller()).save(folder / "run.npz")


FULL = os.environ.get("FPID_TORTURE") == "full"
#: What writes, and at which of its writes the disk fails: every so many, in full and in the suite.
WORK = {
    "Run.save": (1, 1), "output_folder": (1, 1), "tune()": (1, 9), "operators --plot": (1, 0),
    "view --html": (1, 0), "playground --html": (1, 0), "export": (3, 0), "run": (3, 0),
    "tune": (7, 0),
}  # fmt: skip


@pytest.mark.parametrize("what", [what for what, steps in WORK.items() if FULL or steps[1]])
def test_a_disk_that_fails_at_any_write(what, shim, tmp_path, tally):
    every = WORK[what][0 if FULL else 1]
    written(tmp_path)
    done = finished(
        [sys.executable, HERE / "faults.py", tmp_path, what, str(every)],
        env=os.environ | {"LD_PRELOAD": str(shim)}, timeout=3600 if FULL else 250,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in done.stdout.splitlines()]
    for _, code, at, _, fault in rows:
        tally(f"{what}: {code} at a write", fault and f"write {at}: {fault}")
    # A disk that never failed would prove nothing.
    assert sum(told == "refused" for *_, told, _ in rows) >= 5


def command(folder, *arguments, **options):
    done = finished([sys.executable, "-m", "fpid_pin.cli.main", *arguments], cwd=folder, **options)
    said = [line for line in done.stderr.splitlines() if "generation" not in line]
    return done.returncode, said


def snapshot(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


COMMANDS = {
    "run": ("run", "short.toml", "--controller", "integer PID", "--out", "disk/out"),
    "compare": ("compare", "short.toml", "--out", "disk/out"),
    "tune": ("tune", "short.toml", "--out", "disk/out"),
    "demo": ("demo", "--out", "disk/out"),
    "view": ("view", "run.npz", "--html", "disk/page.html"),
    "operators": ("operators", "--order", "0.5", "--plot", "disk/plot.png"),
    "playground": ("playground", "short.toml", "--html", "disk/playground.html"),
    "export": ("export", "short.toml", "--controller", "integer PID", "--out", "disk/c"),
}


@pytest.fixture
def disk(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
    if finished(mount).returncode:
        pytest.skip("tmpfs may not be mounted here")
    yield place
    finished(["umount", str(place)], check=True)


@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_full_and_a_read_only_disk(state, disk, tmp_path, tally):
    written(tmp_path)
    (disk / "out").mkdir()
    (disk / "out" / ".fpid_pin").write_text("")
    (disk / "out" / "older").write_text("results")
    # The page has a megabyte of its own; a figure has not.
    (disk / "ballast").write_bytes(bytes(900_000))
    if state == "read-only":
        finished(["mount", "-o", "remount,ro", str(disk)], check=True)
    before = snapshot(disk)
    for name in COMMANDS if FULL else ["run" if state == "full" else "operators"]:
        status, said = command(tmp_path, *COMMANDS[name])
        after = snapshot(disk)
        extra = {path: after[path] for path in after.keys() - before.keys()}
        checkpoint = {path for path in extra if path.name == "out.checkpoint.npz"}
        fault = ""
        if status != 2 or len(said) != 1 or "cannot be written" not in said[0]:
            fault = f"status {status}, {said}"
        elif extra.keys() - checkpoint or any(after[path] != before[path] for path in before):
            fault = f"left {sorted(map(str, extra))}"
        tally(f"{state} disk", fault and f"{name}: {fault}")
        for path in checkpoint:
            path.unlink()


@pytest.mark.skipif(not FULL, reason="FPID_TORTURE=full")
def test_a_limit_on_the_size_of_files(tmp_path, tally):
    """As a quota has it; needs no rights of an administrator."""
    written(tmp_path)
    (tmp_path / "disk").mkdir()
    before = snapshot(tmp_path)

    def limited():
        resource.setrlimit(resource.RLIMIT_FSIZE, (15_000, 15_000))

    for name in COMMANDS:
        status, said = command(tmp_path, *COMMANDS[name], preexec_fn=limited)
        after = snapshot(tmp_path)
        for path in list(after):
            if path.name == "out.checkpoint.npz":
                path.unlink()
                del after[path]
        whole = status == 2 and len(said) == 1 and "File too large" in said[0] and after == before
        tally("file size limit", "" if whole else f"{name}: {status}, {said}")
