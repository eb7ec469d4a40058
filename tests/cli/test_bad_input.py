"""Wrong input: a line that says what, what was expected and what came, and status 2."""

import contextvars
import shlex

import pytest

from fpid_pin import resources
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main
from fpid_pin.simulation import entry

HEAD, *LAWS = (
    demo_config().text.replace("duration = 20.0", "duration = 0.2").split("[[controller]]")
)
STUDY = (
    "[[controller]]".join([HEAD, LAWS[0], LAWS[-1]])
    + """
[tune]
generations = 1
[tune.space]
kp = [1, 100]

[campaign]
[campaign.uncertain]
payload = { kind = "uniform", low = 0.0, high = 1.0 }
"""
)
OWN = {"own.py": "x = 1\nundefined\n", "bad.py": "def f(:\n", "other/own.py": "x = 1\n"}


def imports(value):
    return {"format = 1": f"format = 1\nimport = {value}"}


def space(bounds, law='kind = "suggested_fpid"'):
    head = STUDY.split("[[controller]]")[0]
    return {STUDY: f"{head}[[controller]]\n{law}\n[tune.space]\nbandwidth = {bounds}\n"}


@pytest.mark.parametrize(
    ("words", "change", "said"),
    [
        ("run", {}, "Missing argument"),
        ("run none.toml", {}, "none.toml: no such file"),
        ("run other", {}, "other: cannot be read (Is a directory)"),
        ("run own.npz", {}, "own.npz: cannot be read (not a text file)"),
        ("run /dev/zero", {}, "/dev/zero: expected at most 16777216 bytes, got more"),
        ("run study.toml", {'kind = "two_link"': 'kind = "two_link"\nlenghts = [1.0]'},
         "study.toml: arm.lenghts: expected none, got 'lenghts'"),
        ("run study.toml --controller 'integer PID'",
         {'kind = "two_link"': 'kind = "two_link"\nchanges = [{limits = {effort = [3, 30]}}]'},
         "falls under any controller"),
        ("run study.toml", {}, "expected one controller, or --controller NAME, got 'FPID, publ"),
        ("run study.toml --controller 'integr PID'", {}, "did you mean integer PID?"),
        ("compare study.toml --every 0", {}, "--every: expected a whole number >= 1, got 0"),
        ("compare study.toml --metric speed", {}, "--metric: expected one of tail, variation,"),
        ("compare study.toml --out own.py", {}, "got a file"),
        ("compare study.toml --out own.py/x", {}, "cannot be written"),
        ("compare study.toml --out other", {}, "other: expected a new folder or one that"),
        ("tune study.toml", space("[0.5, 10]"),
         'tune.space.bandwidth: expected "shared" behind its bounds'),
        ("tune study.toml", space('[-1, 10, "shared"]'), "tune.space.bandwidth.low: expected "),
        ("tune study.toml", {"kp = [1, 100]": "kp = [100, 1]"},
         "tune.space.kp.high: expected more than low (100), got 1"),
        ("tune study.toml", {"kp = [1, 100]": "self = [1, 100]"},
         "tune.space.self: expected one of kp, ki,"),
        ("tune study.toml", {"[tune.space]\nkp = [1, 100]": ""}, "tune.space: expected a value"),
        ("tune study.toml", {"generations = 1": "generatoins = 1"}, "did you mean generations?"),
        ("tune study.toml", {"generations = 1": 'controller = "PID"'},
         "tune.controller: expected one of"),
        ("tune study.toml", {"[tune.space]": "cost = { w2 = -1.0, kind = 'quadratic_cost' }\n"
         "[tune.space]"}, "tune.cost.w2: expected a number >= 0, got -1"),
        # Before a search that would take its time.
        ("tune study.toml --out other", {"generations = 1": "generations = 100000"},
         "other: expected a new folder"),
        ("tune study.toml --out own.py/x", {"generations = 1": "generations = 100000"},
         "cannot be written"),
        ("view none.npz", {}, "none.npz: no such file"),
        ("view own.npz --html page.html", {}, "own.npz: expected a run file"),
        ("live study.toml --controller two", {}, "--controller: expected one of FPID, publ"),
        ("playground study.toml --controller two", {}, "--controller: expected one of FPID, publ"),
        ("export study.toml --controller two --out c", {}, "--controller: expected one of FPID,"),
        ("export study.toml --out c", {}, "expected one controller, or --controller NAME, got "),
        # More than there is of memory, or of life.
        ("run study.toml --controller 'integer PID' --out c", {"duration = 0.2": "duration = 1e9"},
         "duration: expected work that fits into"),
        ("compare study.toml --out c", {"duration = 0.2": "duration = 20", "= 1e-3": "= 1e-9"},
         "2 runs of 2e+10 rows: about "),
        ("tune study.toml --out c", {"generations = 1": f"seeds = {list(range(100_000))}",
         "duration = 0.2": "duration = 20.0"},
         "100000 seeds of 60 runs of 2e+04 rows, 80 times: about 66.7 days"),
        ("tune study.toml --out c", {"generations = 1": "population = 1_000_000_000_000"},
         "search: expected work that fits into"),
        ("operators --order 1.7", {}, "1.7"),
        ("operators --step 5e-324", {}, "step: expected a number in [1e-09, 10]"),
        ("inspect ur55", {}, "got 'ur55' (did you mean ur5?)"),
        ("inspect panda --lock panda_joint77=0", {}, "--lock: expected one of panda_joint1, "),
        ("inspect panda --lock panda_joint7=nan", {},
         "--lock panda_joint7: expected a number finite, got nan"),
        ("inspect panda --keep hnad", {}, "--keep: expected one of "),
        ("init panda --tool hnad", {}, "--tool: expected one of "),
        ("compare study.toml", space("[0.5, 10]", 'kind = "fpid"'),
         "(did you mean adaptive_fpid?)"),
        ("compare study.toml",
         {"[tune]": '[[condition]]\nname = "x"\nplant = { payload = -3 }\n[tune]'},
         "condition.0.plant.payload.mass: expected a number >= 0, got -3"),
        ("compare study.toml",
         {"[tune]": '[[condition]]\nname = "x"\nplant = { payload = { mass = 3, frame = "tol" } }\n'
          "[tune]"},
         "condition.0.plant.payload.frame: expected one of "),
        ("inspect panda --lock door", {}, "--lock: expected JOINT=VALUE, got 'door'"),
        ("inspect two_link --picture arm.bmp", {}, "a name that ends in .svg"),
        ("inspect two_link --step nan", {}, "step: expected a number"),
        ("inspect two_link --bandwidth nan", {}, "bandwidth: expected a number"),
        ("init two_link --out own.py", {}, "own.py: expected a new file, got one"),
        ("campaign run study.toml --workers 2 --dask tcp://127.0.0.1:1", {}, "not both"),
        ("campaign run study.toml --workers 0", {}, "workers: expected a whole number >= 1"),
        ("campaign run study.toml --chunk 0", {}, "chunk: expected a whole number >= 1"),
        ("tune study.toml --workers 0", {}, "workers: expected a whole number >= 1, got 0"),
        ("campaign run study.toml --runs 0", {}, "runs: expected a whole number >= 1, got 0"),
        ("campaign run study.toml --out own.py", {}, "file is not a database"),
        ("campaign resume none.sqlite", {}, "expected a campaign's ledger, got no file"),
        ("compare study.toml", imports('"own.py"'), "import: expected --allow-import, as the code"),
        ("compare study.toml --allow-import", imports('"own.py"'),
         "import: own.py:2: NameError: name 'undefined' is not defined"),
        ("compare study.toml --allow-import", imports('"bad.py"'), "bad.py:1: SyntaxError"),
        ("compare study.toml --allow-import", imports(3),
         "import: expected a path, or a list of them, got 3"),
        ("compare study.toml --allow-import", imports('"none.py"'),
         "import: expected a Python file, got"),
        ("compare study.toml --allow-import", imports('["other/own.py", "own.py"]'),
         "expected files of different names, got own.py twice"),
    ],
)  # fmt: skip
def test_wrong_input_is_one_line_and_status_2(words, change, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(entry, "start_robots", None)  # Any work would fail otherwise.
    monkeypatch.setattr(resources, "memory", lambda: 10**12)
    text = STUDY
    for old, new in change.items():
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "other").mkdir()
    for name, content in {"study.toml": text, **OWN}.items():
        (tmp_path / name).write_text(content)
    (tmp_path / "own.npz").write_bytes(b"\xff\xfe\x00")
    before = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    status = contextvars.copy_context().run(main, shlex.split(words))
    assert status == 2
    told = capsys.readouterr()
    lines = [line for line in told.err.splitlines() if " plants, " not in line]
    assert len(lines) == 1, told.err
    assert lines[0].startswith("fpid-pin: ")
    assert said in lines[0]
    assert told.out == ""
    after = {path: path.is_file() and path.read_bytes() for path in tmp_path.rglob("*")}
    assert {path: data for path, data in after.items() if "__pycache__" not in str(path)} == before
