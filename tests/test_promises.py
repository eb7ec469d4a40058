"""What docs/promises.md promises: its tests are there; those without another place are here."""

import ast
import contextlib
import hashlib
import json
import os
import re
import sys
from pathlib import Path

import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main

ROOT = Path(__file__).parents[1]
LAW = "[[controller]]"
PAGE = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
HEAD, *LAWS = demo_config().text.replace("duration = 20.0", "duration = 0.05").split(LAW)
SHORT = LAW.join([HEAD, LAWS[0], LAWS[-1]])

TUNE = """
[tune]
population = 4
generations = 2
map_points = 0
[tune.space]
kp = [1, 100]
"""


def test_every_promise_has_tests_and_they_are_there():
    rows = re.findall(r"^\| (.*) \| (.*) \|$", PAGE, re.MULTILINE)
    assert len(rows) > 20
    for promise, cell in rows:
        if set(promise) <= set("-") or promise == "promise":
            continue
        named = re.findall(r"`(tests/[\w/]+\.py)(?:::(\w+))?`", cell)
        assert named, promise
        for path, name in named:
            tree = ast.parse((ROOT / path).read_text(encoding="utf-8"))
            functions = {node.name for node in tree.body if isinstance(node, ast.FunctionDef)}
            assert not name or name in functions, f"{path}::{name}"


WATCHED = """
import json, sys
from fpid_pin.cli.main import main
import fpid_pin as fp
EVENTS = {"socket", "subprocess", "os.system", "os.exec", "os.posix_spawn", "os.fork", "pickle",
          "exec", "compile", "import", "urllib", "webbrowser", "ctypes"}
seen, on = set(), [False]

def hook(event, arguments):
    if on[0] and (event in EVENTS or event.partition(".")[0] in EVENTS):
        seen.add(event + " " + str(arguments[:1])[:80])

sys.addaudithook(hook)
"""


def watched(code, folder):
    """Return what a piece of code did that a hook can see, while ``on[0]``."""
    done = finished(
        [sys.executable, "-c", WATCHED + code + "\nsys.stderr.write(json.dumps(sorted(seen)))"],
        cwd=folder,
        check=True,
    )
    return json.loads(done.stderr.splitlines()[-1])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("watched")
    (place / "short.toml").write_text(SHORT)
    (place / "tune.toml").write_text(SHORT + TUNE)
    run = fp.simulate(fp.paper_experiment(duration=0.05), fp.paper_controller())
    run.save(place / "run.npz")
    return place


READ = """
from pathlib import Path
from fpid_pin.cli.configuration import load
from fpid_pin.tuning import SearchSettings, Space, tune
def search():
    settings = SearchSettings(population=4, generations=1, checkpoint="search.npz", resume=True)
    return tune(fp.paper_experiment(duration=0.05), fp.paper_controller(), Space(kp=(1, 100)),
                settings=settings)
def all():
    run = fp.Run.load("run.npz")
    run.arm, run.controller, run.experiment, run.metrics
    load("short.toml")
    search()
search()
all()  # what the package itself imports late is imported now
on[0] = True
all()
on[0] = False
"""


def test_nothing_in_a_file_is_executed(folder):
    # The last line, which is no file's, shows that the hook sees what it is there for.
    told = watched(READ + "on[0] = True\neval('1')\n", folder)
    of_the_line = ("compile (b'1',)", "exec (<code object <module> at 0x")
    # NumPy has headers of arrays parsed into a syntax tree, a literal; nothing of it is run.
    others = [x for x in told if not x.startswith((*of_the_line, "compile (b\"{'descr': "))]
    assert others == []
    assert all(any(x.startswith(start) for x in told) for start in of_the_line)


NETWORK = """
import os
os.environ["PATH"] = ""  # no compiler, which would take long to measure an export
on[0] = True
for words in (
    ["run", "short.toml", "--controller", "integer PID"],
    ["view", "run.npz", "--html", "page.html"],
    ["operators", "--order", "0.5", "--plot", "plot.png"],
    ["playground", "short.toml", "--html", "playground.html"],
    ["export", "short.toml", "--controller", "integer PID", "--out", "c", "--ticks", "5"],
    ["tune", "tune.toml", "--out", "tuned"],
    ["arms"],
):
    assert main(words) == 0
import socket
socket.socket().close()
on[0] = False
"""


def test_no_command_reaches_for_the_network(folder):
    told = [line for line in watched(NETWORK, folder) if line.startswith(("socket", "urllib"))]
    # Modules that could are imported by others; asking for the machine's own name goes nowhere.
    told = [line for line in told if not line.startswith("socket.gethostname")]
    # The last line of all, which shows that the hook sees what it is there for.
    assert [line.split()[0] for line in told] == ["socket.__new__"]
    page = (folder / "page.html").read_text()
    assert "default-src 'none'" in page


def test_a_command_gives_the_same_bytes_in_any_process(folder):
    """Here, and in another process with other hashes."""
    commands = (
        ["compare", "short.toml", "--out", "{}"],
        ["playground", "short.toml", "--html", "{}/page.html"],
    )
    with contextlib.chdir(folder):
        for words in commands:
            assert main([word.format("first") for word in words]) == 0
            words = [word.format("second") for word in words]
            finished([sys.executable, "-m", "fpid_pin.cli.main", *words], check=True,
                     env=os.environ | {"PYTHONHASHSEED": "7"})  # fmt: skip
    told = []
    for out in ("first", "second"):
        files = sorted((folder / out).iterdir())
        told.append({f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files})
    assert len(told[0]) > 9
    assert told[0] == told[1]
