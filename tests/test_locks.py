"""One process at a time, and none that keeps others out after its end."""

import fcntl
import os
import signal
import subprocess
import sys
import threading

import pytest
from bounded import ended, started

import fpid_pin as fp
from fpid_pin.exceptions import FileFormatError
from fpid_pin.locks import locked

HOLD = """
import sys, time
from fpid_pin.locks import locked
with locked(sys.argv[1]):
    print("mine", flush=True)
    time.sleep(60)
"""


def test_a_second_one_is_refused_and_the_lock_goes_with_the_first(tmp_path):
    path = tmp_path / "folder" / "file"
    with locked(path):
        with pytest.raises(FileFormatError) as caught, locked(path):
            pass
        with locked(path.with_name("other")):
            pass
    process = f"(process {os.getpid()})"
    assert str(caught.value) == (
        f"{path}: expected to be alone with it, got another fpid-pin at work there {process}"
    )
    assert list(path.parent.iterdir()) == []
    with locked(path):
        pass


def test_a_killed_process_keeps_nobody_out(tmp_path):
    path = tmp_path / "file"
    command = [sys.executable, "-c", HOLD, str(path)]
    with started(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "mine\n"
        with pytest.raises(FileFormatError, match=rf"\(process {other.pid}\)"), locked(path):
            pass
        other.send_signal(signal.SIGKILL)
    assert len(list(tmp_path.iterdir())) == 1
    with locked(path):
        pass
    assert list(tmp_path.iterdir()) == []


def test_of_many_at_once_never_two_are_in(tmp_path):
    inside, most, refused = [], [], []

    def work():
        for _ in range(200):
            try:
                with locked(tmp_path / "file"):
                    inside.append(1)
                    most.append(len(inside))
                    inside.pop()
            except FileFormatError:
                refused.append(1)

    threads = [threading.Thread(target=work, daemon=True) for _ in range(8)]
    for thread in threads:
        thread.start()
    assert all(ended(thread) for thread in threads)
    assert set(most) == {1}
    assert len(most) + len(refused) == 1600
    assert list(tmp_path.iterdir()) == []


def test_where_there_are_no_locks_a_warning_says_so(tmp_path, monkeypatch):
    def none(handle, what):
        raise OSError(38, "Function not implemented")

    monkeypatch.setattr(fcntl, "flock", none)
    entered = []
    with pytest.warns(fp.FpidWarning, match="cannot be locked"), locked(tmp_path / "file"):
        entered.append(True)
    assert entered


def test_a_lock_that_cannot_be_made_is_one_line(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(FileFormatError, match="cannot be written"), locked(tmp_path / "file" / "x"):
        pass
