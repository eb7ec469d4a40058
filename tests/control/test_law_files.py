"""Each process runs a law as it stands in its file, whatever the cache holds; also uncompiled.

Every test has processes of its own; all share one cache, in which the engine is compiled already.
"""

import json
import os
import shutil
import sys
from pathlib import Path

import every_law
import numpy as np
import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.kernels.compiled import CACHE

HERE = Path(__file__).parent
LAW = """
from dataclasses import dataclass
import fpid_pin as fp
from shapes import bent

@dataclass(frozen=True, eq=False)
class Own(fp.Controller):
    kp: float = 3.0

    @staticmethod
    def torque(c):
        return GAIN * c.kp * bent(c.e)

GAIN = 1.0
"""
SHAPES = """
def bent(x, width=1.0):
    return inner(x) / width

def inner(x):
    return x
"""
PLAY = """
import numpy as np
import fpid_pin as fp

def play(law):
    loop = law.start(fp.Arm.two_link(), step=1e-3)
    print(loop.torque(np.zeros(2), np.zeros(2), np.array([1.0, 2.0]), np.zeros(2)).tolist())
"""


@pytest.fixture(scope="module")
def cache(tmp_path_factory):
    """Return a cache of its own, with all that this one has but laws: the engine takes long."""
    fp.Pid(1.0, 0.0, 0.0).start(fp.Arm.two_link(), step=1e-3).torque(*np.zeros((4, 2)))
    place = tmp_path_factory.mktemp("cache")
    # Nor files that another process is writing.
    left_out = shutil.ignore_patterns("*.law_*", "*.tmp.*")
    shutil.copytree(CACHE, place / CACHE.name, ignore=left_out)
    return place


@pytest.fixture
def run(cache, tmp_path):
    """Return what runs a script in its own process and returns the torques that it prints."""
    (tmp_path / "play.py").write_text(PLAY)
    (tmp_path / "shapes.py").write_text(SHAPES)
    (tmp_path / "laws.py").write_text(LAW)

    def process(text):
        (tmp_path / "main.py").write_text(text)
        places = {"NUMBA_CACHE_DIR": str(cache), "XDG_CACHE_HOME": str(cache / "home")}
        # With its own bytecode kept, Python would not see an edit within the same second.
        done = finished(
            [sys.executable, "-B", "-W", "error", "main.py"],
            cwd=tmp_path, timeout=240, env=os.environ | places,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr[-2000:]
        return [json.loads(line) for line in done.stdout.splitlines()]

    process.folder = tmp_path
    return process


IMPORTED = "from laws import Own\nfrom play import play\nplay(Own())\n"


def edit(path, old, new):
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new))


def compiled(cache):
    """Return the files of compiled laws, by when they were written."""
    return {path: path.stat().st_mtime_ns for path in cache.rglob("*.law_*.nbc")}


#: What a law is made of: edits of it and of whatever it calls, and by how much they change it.
EDITS = [
    ("laws", "GAIN * c.kp", "2.0 * GAIN * c.kp", 2.0),
    ("laws", "GAIN = 1.0", "GAIN = 10.0", 10.0),
    ("shapes", "width=1.0", "width=2.0", 0.5),
    ("shapes", "    return x\n", "    return -x\n", -1.0),
]
#: Imported functions, modules of constants, arrays, a global of a field's name.
USES = {
    "from math import tanh as bent": "c.kp * bent(c.e)",
    "from numpy import tanh as bent": "c.kp * bent(c.e)",
    "import constants": "constants.HALF * c.kp * c.e",
    "import numpy as np\nTABLE = np.array([1.0, 2.0])\nkp = {}": "TABLE[1] * c.kp * c.e",
}


def test_an_edited_law_and_whatever_it_calls_act_at_once_from_a_warm_cache(run, cache):
    """A moved law is the same law, and one that is deleted harms no other."""
    for k in range(len(EDITS)):
        text = LAW.replace("from shapes", f"from shapes{k}").replace("3.0", f"{3.0 + k}")
        (run.folder / f"laws{k}.py").write_text(text)
        (run.folder / f"shapes{k}.py").write_text(SHAPES)
    constants, table = run.folder / "constants.py", run.folder / "uses3.py"
    constants.write_text("HALF = 0.5\n")
    for k, (use, body) in enumerate(USES.items()):
        text = LAW.replace("from shapes import bent", use)
        (run.folder / f"uses{k}.py").write_text(text.replace("GAIN * c.kp * bent(c.e)", body))
    names = [f"laws{k}" for k in range(len(EDITS))] + [f"uses{k}" for k in range(len(USES))]
    script = "".join(IMPORTED.replace("laws", name) for name in names)
    first = run(script + IMPORTED)
    edited, used = first[: len(EDITS)], first[len(EDITS) : -1]
    assert edited == [[3.0 + k, 2.0 * (3.0 + k)] for k in range(len(EDITS))]
    for torque in used[:2]:
        assert torque == pytest.approx(3.0 * np.tanh([1.0, 2.0]), rel=1e-12)
    kept = compiled(cache)
    # Laws of the same code, whatever file it stands in, share a build.
    assert len(kept) == 1 + len(USES)
    (run.folder / "laws.py").rename(run.folder / "elsewhere.py")
    assert run(script + IMPORTED.replace("laws", "elsewhere")) == first
    assert compiled(cache) == kept, "the second process compiled them again"
    (run.folder / "elsewhere.py").unlink()
    for path in kept:
        path.write_bytes(b"damaged, so compiled anew")
    for k, (name, old, new, _) in enumerate(EDITS):
        edit(run.folder / f"{name}{k}.py", old, new)
    constants.write_text("HALF = 0.25\n")
    edit(table, "2.0])", "1.0])")
    again = run(script)
    for torque, before, (_, _, new, factor) in zip(again, edited, EDITS, strict=False):
        assert torque == [factor * x for x in before], new
    halved = [[x / 2.0 for x in torque] for torque in used[2:]]
    assert again[len(EDITS) :] == used[:2] + halved
    assert sum(path.read_bytes()[:7] == b"damaged" for path in kept) < len(kept)


def test_laws_of_a_script_and_of_a_notebook_s_cells_run_as_they_stand(run):
    """A notebook has no file, one namespace, and a class and its helper defined anew."""
    cells = f"""
cells = {{"__name__": "__main__"}}
exec({LAW!r}, cells)
play(cells["Own"]())
exec("GAIN = 5.0", cells)
play(cells["Own"]())
exec("def bent(x):\\n    return -x", cells)
play(cells["Own"]())
exec({LAW.replace("c.kp *", "c.kp * 2.0 *")!r}, cells)
play(cells["Own"]())
"""
    for gain in (1.0, 4.0):
        script = (
            LAW.replace("GAIN = 1.0", f"GAIN = {gain}") + "from play import play\nplay(Own())\n"
        )
        found = run(script + cells)
        assert found[0] == [3.0 * gain, 6.0 * gain]
        assert found[1:] == [[3.0, 6.0], [15.0, 30.0], [-15.0, -30.0], [6.0, 12.0]]


def test_without_compilation_every_law_gives_the_same_torques(cache):
    done = finished(
        [sys.executable, HERE / "every_law.py"],
        env=os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONPATH": os.pathsep.join(sys.path)},
        timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    plain = json.loads(done.stdout)
    for name, rows in every_law.torques().items():
        size = np.abs(rows).max()
        assert size > 0.1, name
        assert np.abs(np.array(plain[name]) - rows).max() < 1e-12 * max(size, 1.0), name
