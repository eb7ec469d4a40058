"""What docs/promises.md promises: its tests are there; those without another place are here."""

import ast
import hashlib
import json
import re
import sys
from pathlib import Path

import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.cli.experiments import demo_config

ROOT = Path(__file__).parents[1]
PAGE = (ROOT / "docs" / "promises.md").read_text(encoding="utf-8")
SHORT = demo_config().text.replace("duration = 20.0", "duration = 0.05")

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


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "short.toml").write_text(SHORT)
    (tmp_path / "tune.toml").write_text(SHORT + TUNE)
    run = fp.simulate(fp.paper_experiment(duration=0.05), fp.paper_controller())
    run.save(tmp_path / "run.npz")
    return tmp_path


READ = """
from pathlib import Path
from fpid_pin.cli.config import load
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
    # NumPy has headers of arrays parsed into a syntax tree, a literal; nothing of it is run.
    parsed = "compile (b\"{'descr': "
    assert [line for line in watched(READ, folder) if not line.startswith(parsed)] == []


def test_the_hook_sees_what_it_is_there_for(folder):
    code = "on[0] = True\neval('1')\nimport socket\nsocket.socket().close()\non[0] = False"
    told = watched(code, folder)
    assert any(line.startswith("compile") for line in told)
    assert any(line.startswith("socket") for line in told)


NETWORK = """
on[0] = True
for words in (
    ["run", "short.toml", "--controller", "integer PID"],
    ["view", "run.npz", "--html", "page.html"],
    ["operators", "--order", "0.5", "--plot", "plot.png"],
    ["compare", "short.toml", "--out", "compared"],
    ["playground", "short.toml", "--html", "playground.html"],
    ["export", "short.toml", "--controller", "integer PID", "--out", "c", "--ticks", "5"],
    ["tune", "tune.toml", "--out", "tuned"],
    ["arms"],
):
    assert main(words) == 0
on[0] = False
"""


def test_no_command_reaches_for_the_network(folder):
    told = [line for line in watched(NETWORK, folder) if line.startswith(("socket", "urllib"))]
    # Modules that could are imported by others; asking for the machine's own name goes nowhere.
    assert [line for line in told if not line.startswith("socket.gethostname")] == []
    page = (folder / "page.html").read_text()
    assert "default-src 'none'" in page


def test_a_command_gives_the_same_bytes_in_any_process(folder):
    told = []
    for out in ("first", "second"):
        finished(
            [sys.executable, "-m", "fpid_pin_start", "compare", "short.toml", "--out", out],
            cwd=folder,
            check=True,
        )
        files = sorted((folder / out).iterdir())
        told.append({f.name: hashlib.sha256(f.read_bytes()).hexdigest() for f in files})
    assert len(told[0]) > 10
    assert told[0] == told[1]
