"""Whatever a disk refuses is one line; older results stay, and nothing half written does."""

import json
import os
import shutil
import sys
from pathlib import Path

import pytest
from bounded import FULL, finished

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
    "view": (1, 1), "playground": (1, 0), "export": (3, 0), "run": (3, 0), "compare": (7, 0),
    "tune": (7, 0),
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
