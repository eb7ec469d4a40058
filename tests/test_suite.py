"""The suite itself: the same examples each time, no wait without an end, nothing left running."""

import ast
import os
import signal
import sys
from pathlib import Path

import psutil
from bounded import finished

HERE = Path(__file__).parent
#: Methods that wait until something happens, where they are given no limit.
WAITS = {"acquire", "get", "join", "result", "wait"}

EXAMPLES = """
import sys
sys.path.insert(0, {folder!r})
import conftest
from hypothesis import given, strategies as st
{before}
drawn = []

@given(st.integers() | st.floats() | st.text())
def draw(value):
    drawn.append(value)

draw()
print(drawn)
"""


def test_hypothesis_draws_the_same_examples_whatever_else_is_loaded():
    told = set()
    environment = {key: value for key, value in os.environ.items() if key != "FPID_TORTURE"}
    for before in ("", "import fpid_pin.campaign, fpid_pin.view"):
        code = EXAMPLES.format(folder=str(HERE), before=before)
        told.add(finished([sys.executable, "-c", code], check=True, env=environment).stdout)
    assert len(told) == 1
    assert len(told.pop()) > 1000


INNER = """
import signal, subprocess, sys

def test_ctrl_c_is_heard():
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
    code = "import signal; assert signal.getsignal(signal.SIGINT) is signal.default_int_handler"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)

def test_it():
    # Through another that is gone, so that it is nobody's child.
    code = "import subprocess; subprocess.Popen(['sleep', 'LONG']); subprocess.Popen(['true'])"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
"""


def test_in_the_background_ctrl_c_is_heard_and_a_process_left_behind_is_told_of_and_killed(
    tmp_path,
):
    """A shell starts what runs in the background with Ctrl-C ignored."""

    def ignore():
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    own = (HERE / "conftest.py").read_text(encoding="utf-8")
    assert "timeout=10.0" in own
    (tmp_path / "conftest.py").write_text(own.replace("timeout=10.0", "timeout=0.5"))
    long = f"654.{os.getpid()}"  # other suites may run on this machine
    (tmp_path / "test_it.py").write_text(INNER.replace("LONG", long))
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_it.py"]
    done = finished(command, cwd=tmp_path, preexec_fn=ignore)
    assert done.returncode == 1
    assert "2 passed, 1 error" in done.stdout
    assert f"sleep {long} (started by test_it.py::test_it (call))" in done.stdout
    commands = [process.info["cmdline"] for process in psutil.process_iter(["cmdline"])]
    assert ["sleep", long] not in commands


def waits_for_ever(call):
    """Return whether a call may wait without a limit."""
    name = ast.unparse(call.func)
    if name.startswith("subprocess."):
        return True
    bare = not call.args and not call.keywords
    return isinstance(call.func, ast.Attribute) and call.func.attr in WAITS and bare


def test_no_wait_is_without_an_end():
    """Programs are run by `bounded.finished` and `bounded.started`; in the latter all waits end."""
    told = {
        f"{path.relative_to(HERE)}: {ast.unparse(node)}"
        for path in HERE.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and waits_for_ever(node)
    }
    assert {call for call in told if "child.wait()" not in call} == {
        "bounded.py: subprocess.Popen(arguments, **options)",
        "bounded.py: subprocess.run(arguments, **given | options)",
    }
