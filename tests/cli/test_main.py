"""How the command ends: one line for what the system refuses, a status for Ctrl-C."""

import signal
import subprocess
import sys
import time

import pytest
from bounded import finished, started

from fpid_pin.cli.main import main

COMMAND = [sys.executable, "-m", "fpid_pin.cli.main"]
PIPES = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}


@pytest.mark.parametrize(
    ("error", "line"),
    [
        (OSError(28, "No space left on device", "x.npz"), "x.npz: No space left on device"),
        (OSError("no more"), "standard output: no more"),
        (MemoryError(), "out of memory"),
        (ZeroDivisionError("a fault of ours, which is not hidden"), None),
    ],
)
def test_what_the_system_refuses_is_one_line_and_status_2(monkeypatch, capsys, error, line):
    def fail():
        raise error

    monkeypatch.setattr("fpid_pin.cli.arms.arm_rows", fail)
    if line is None:
        with pytest.raises(ZeroDivisionError):
            main(["arms"])
    else:
        assert main(["arms"]) == 2
        assert capsys.readouterr().err == f"fpid-pin: {line}\n"


@pytest.mark.skipif(sys.platform != "linux", reason="macOS has no /dev/full")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("--help > /dev/full", "fpid-pin: standard output: No space left on device\n"),
        ("arms | true", "fpid-pin: standard output: Broken pipe\n"),
        ("run none.toml 2> /dev/full", ""),  # the status says it
    ],
)
def test_output_that_takes_no_more_is_one_line_and_status_2(words, said):
    done = finished(["bash", "-o", "pipefail", "-c", f"{' '.join(COMMAND)} {words}"])
    assert (done.returncode, done.stderr) == (2, said)


class Careless:
    def __del__(self):
        signal.raise_signal(signal.SIGINT)


class HalfMade:
    def __init__(self):
        signal.raise_signal(signal.SIGINT)
        self.pointer = 1

    def __del__(self):
        self.pointer += 1


@pytest.mark.parametrize("where", ["ours", "a destructor", "a library", "a constructor"])
def test_ctrl_c_is_heard_also_where_it_would_be_lost_and_nothing_complains(
    monkeypatch, capsys, where
):
    def work():
        if where == "a destructor":
            Careless()  # Python prints what a destructor raises, and goes on.
        elif where == "a constructor":
            HalfMade()
        else:
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                if where == "a library":
                    raise ImportError("initialisation failed") from None
                raise
        time.sleep(10.0)
        pytest.fail("Ctrl-C was lost")

    told = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    before = signal.getsignal(signal.SIGINT), sys.unraisablehook
    monkeypatch.setattr("fpid_pin.cli.arms.arm_rows", work)
    assert main(["arms"]) == 130
    assert capsys.readouterr().err == "fpid-pin: stopped\n"
    assert (signal.getsignal(signal.SIGINT), sys.unraisablehook) == before
    assert told == []


def test_a_command_in_the_background_does_not_hear_ctrl_c():
    def ignore():
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # as the shell does

    with started([*COMMAND, "operators", "--order", "0.5"], preexec_fn=ignore, **PIPES) as child:
        while child.poll() is None:
            child.send_signal(signal.SIGINT)
            time.sleep(0.02)
        assert child.communicate()[1] == ""
    assert child.returncode == 0


ENDING = """
import atexit, sys
from fpid_pin.cli.main import program
sys.argv[1:] = ["--version"]
sys.heap = {k: [k] for k in range(500_000)}  # which takes a while to be taken down
atexit.register(print, "leaving", flush=True)
program()
"""


def test_ctrl_c_while_python_takes_itself_down_changes_nothing():
    """Python gives signals back before it has ended: what was done ended by the signal."""
    with started([sys.executable, "-c", ENDING], **PIPES) as child:
        assert child.stdout.readline().startswith("fpid-pin ")
        assert child.stdout.readline() == "leaving\n"
        time.sleep(0.02)
        child.send_signal(signal.SIGINT)
        assert child.communicate()[1] == ""
    assert child.returncode == 0
