"""Whatever a disk refuses is one line; older results stay, and nothing half written does."""

import json
import os
import resource
import shutil
import sys
from pathlib import Path

import pytest
from bounded import FULL, finished
from faults import COMMANDS

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


#: What writes, and at which of its writes the disk fails: every so many, in full and in the suite.
WRITES = {
    "Run.save": (1, 1), "output_folder": (1, 1), "tune()": (1, 9), "operators": (1, 0),
    "view": (1, 0), "playground": (1, 0), "export": (3, 0), "run": (3, 0), "tune": (7, 0),
}  # fmt: skip


@pytest.mark.parametrize("what", [what for what, steps in WRITES.items() if FULL or steps[1]])
def test_a_disk_that_fails_at_any_write(what, shim, tmp_path, tally):
    every = WRITES[what][0 if FULL else 1]
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


@pytest.fixture
def disk(request, tmp_path):
    """Return a folder that will take no more, and how to run a program that writes into it."""
    place, options = tmp_path / "disk", {}
    place.mkdir()
    written(tmp_path)
    mounted = request.param != "limited"
    if mounted:
        mount = ["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]
        if finished(mount).returncode:
            pytest.skip("tmpfs may not be mounted here")
        # 36 kB are left: an export of five ticks took 100.
        (place / "ballast").write_bytes(bytes(1_010_000))
    else:  # as a quota has it; needs no rights of an administrator
        sizes = (15_000, 15_000)
        options["preexec_fn"] = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, sizes)
        # A measurement of coverage has a file of its own, which would not fit either.
        options["env"] = {k: v for k, v in os.environ.items() if not k.startswith("COV")}
    (place / "out").mkdir()
    (place / "out" / ".fpid_pin").write_text("")
    (place / "out" / "older").write_text("results")
    if request.param == "read-only":
        finished(["mount", "-o", "remount,ro", str(place)], check=True)
    yield place, options
    if mounted:
        finished(["umount", str(place)], check=True)


def snapshot(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


FEW = {"full": ["run"], "read-only": ["operators"], "limited": ["compare"]}


@pytest.mark.parametrize(("state", "disk"), [(state, state) for state in FEW], indirect=["disk"])
def test_a_full_and_a_read_only_disk(state, disk, tmp_path, tally):
    place, options = disk
    before = snapshot(place)
    why = "File too large" if state == "limited" else "cannot be written"
    for name in COMMANDS if FULL else FEW[state]:
        program = [sys.executable, "-m", "fpid_pin.cli.main", *COMMANDS[name]]
        done = finished(program, cwd=tmp_path, **options)
        said = [line for line in done.stderr.splitlines() if "generation" not in line]
        after = snapshot(place)
        extra = {path for path in after if path not in before}
        checkpoint = {path for path in extra if path.name == "out.checkpoint.npz"}
        fault = ""
        if done.returncode != 2 or len(said) != 1 or why not in said[0]:
            fault = f"status {done.returncode}, {said}"
        elif extra - checkpoint or any(after[path] != before[path] for path in before):
            fault = f"left {sorted(map(str, extra))}"
        tally(f"{state} disk", fault and f"{name}: {fault}")
        for path in checkpoint:
            path.unlink()
