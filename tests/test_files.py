"""Files appear whole or not at all, as readable as any other; one process at a time has a lock."""

import errno
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from bounded import started

from fpid_pin.cli.output import output_folder
from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import hidden_folder, locked, replacing


def write(path, text):
    with replacing(path) as temporary:
        temporary.write_text(text)


def test_a_file_is_replaced_at_the_end_of_the_block(tmp_path):
    path = tmp_path / "deep" / "file.txt"
    write(path, "old")
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert [p.name for p in path.parent.iterdir()] == ["file.txt"]


def test_an_error_in_the_block_leaves_the_old_file_and_nothing_else(tmp_path):
    path = tmp_path / "file.txt"
    write(path, "old")
    with pytest.raises(TypeError), replacing(path) as temporary:
        # Fails once the temporary file is there.
        temporary.write_text(None)
    assert path.read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["file.txt"]


def made(kind, path):
    if kind == "a symlink":
        path.with_name("elsewhere").write_text("mine")
        path.symlink_to("elsewhere")
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(os.path.relpath(path))
    elif kind == "a folder":
        path.mkdir()
    return path


@pytest.mark.parametrize("kind", ["a folder", "a symlink", "a FIFO", "a socket", "a device"])
def test_only_files_are_replaced(tmp_path, monkeypatch, kind):
    monkeypatch.chdir(tmp_path)
    path = Path("/dev/null") if kind == "a device" else made(kind, tmp_path / "target")
    before, others = path.lstat(), sorted(tmp_path.iterdir())
    with pytest.raises(FileFormatError, match=f"expected a regular file or none, got {kind}"):
        write(path, "text")
    after = path.lstat()
    assert (after.st_ino, after.st_mode) == (before.st_ino, before.st_mode)
    assert sorted(tmp_path.iterdir()) == others


def test_what_became_of_the_place_meanwhile_is_looked_at_again(tmp_path):
    path = tmp_path / "target"
    with pytest.raises(FileFormatError, match="got a symlink"), replacing(path):
        made("a symlink", path)
    assert path.read_text() == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["elsewhere", "target"]


def test_a_name_may_be_as_long_as_the_system_allows(tmp_path):
    write(tmp_path / ("a" * 255), "text")
    with pytest.raises(FileFormatError, match="File name too long"):
        write(tmp_path / ("a" * 256), "text")
    assert [p.name for p in tmp_path.iterdir()] == ["a" * 255]


def test_an_error_of_the_system_in_the_block_is_one_line(tmp_path):
    with pytest.raises(FileFormatError) as caught, replacing(tmp_path / "file"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(caught.value) == f"{tmp_path / 'file'}: cannot be written (No space left on device)"
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_on_the_disk_before_it_takes_the_place_and_its_folder_after(
    tmp_path, monkeypatch
):
    told, fsync, replace = [], os.fsync, os.replace

    def record_sync(handle):
        told.append(("sync", os.readlink(f"/proc/self/fd/{handle}")))
        fsync(handle)

    def record_replace(old, new):
        told.append(("replace", str(new)))
        replace(old, new)

    monkeypatch.setattr(os, "fsync", record_sync)
    monkeypatch.setattr(os, "replace", record_replace)
    path = tmp_path / "new" / "folder" / "file"
    with replacing(path) as temporary:
        temporary.write_text("text")
    assert told == [("sync", str(temporary)), ("replace", str(path)), ("sync", str(path.parent))]


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_results_are_as_readable_as_other_files(tmp_path, monkeypatch, mask):
    before = os.umask(mask)
    try:
        # For all threads of the process, even if only for a moment.
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", lambda mask: pytest.fail("the umask was set"))
            write(tmp_path / "file.txt", "")
            with output_folder(tmp_path / "folder"):
                pass
    finally:
        os.umask(before)
    assert (tmp_path / "file.txt").stat().st_mode & 0o777 == 0o666 & ~mask
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o777 & ~mask


# ---------------------------------------------------------------------- locks

HOLD = """
import sys, time
from pathlib import Path
from fpid_pin.files import hidden_folder, locked
with locked(sys.argv[1]), hidden_folder(Path(sys.argv[1])):
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
    line = f"{path}: expected to be alone with it, got another fpid-pin at work there"
    assert str(caught.value) == line
    assert list(path.parent.iterdir()) == []
    path.write_text("")
    with pytest.raises(FileFormatError, match="cannot be written"), locked(path / "x"):
        pass


def test_a_killed_process_keeps_nobody_out_and_what_it_left_is_removed(tmp_path):
    path = tmp_path / "file"
    command = [sys.executable, "-c", HOLD, str(path)]
    with started(command, stdout=subprocess.PIPE, text=True) as other:
        assert other.stdout.readline() == "mine\n"
        with pytest.raises(FileFormatError, match="got another fpid-pin at work"), locked(path):
            pass
        other.send_signal(signal.SIGKILL)
    assert len(list(tmp_path.iterdir())) == 2
    with hidden_folder(tmp_path / "other") as kept, locked(path):
        assert kept.exists()
    assert list(tmp_path.iterdir()) == []
