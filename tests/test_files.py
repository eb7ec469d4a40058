"""Files appear whole or not at all, as readable as any other."""

import errno
import os
import signal
import socket
import sys
import time
from pathlib import Path

import pytest
from bounded import started

from fpid_pin.cli.output import output_folder
from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import OLD, hidden_beside, replacing, undisturbed


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


@pytest.mark.parametrize("name", ["folder", "."])
def test_a_folder_is_not_replaced_and_nothing_is_left_beside_it(tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "folder").mkdir()
    with pytest.raises(FileFormatError, match="expected a regular file or none, got a folder"):
        write(name, "text")
    assert [p.name for p in tmp_path.iterdir()] == ["folder"]


def made(kind, path):
    if kind == "a symlink":
        path.with_name("elsewhere").write_text("mine")
        path.symlink_to("elsewhere")
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(os.path.relpath(path))
    return path


@pytest.mark.parametrize("kind", ["a symlink", "a FIFO", "a socket", "a device"])
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


def test_a_name_of_the_greatest_length_has_a_hidden_one(tmp_path):
    write(tmp_path / ("a" * 255), "text")
    with pytest.raises(FileFormatError, match="File name too long"):
        write(tmp_path / ("a" * 256), "text")
    assert [p.name for p in tmp_path.iterdir()] == ["a" * 255]


def test_an_error_of_the_system_in_the_block_is_one_line(tmp_path):
    with pytest.raises(FileFormatError) as caught, replacing(tmp_path / "file"):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(caught.value) == f"{tmp_path / 'file'}: cannot be written (No space left on device)"
    assert list(tmp_path.iterdir()) == []


def traced(monkeypatch):
    """Return a list of what is brought to the disk or renamed from now on, in order."""
    told = []
    fsync, replace = os.fsync, os.replace

    def record_sync(handle):
        told.append(("sync", os.readlink(f"/proc/self/fd/{handle}")))
        fsync(handle)

    def record_replace(old, new):
        told.append(("replace", str(new)))
        replace(old, new)

    monkeypatch.setattr(os, "fsync", record_sync)
    monkeypatch.setattr(os, "replace", record_replace)
    return told


def test_a_file_is_on_the_disk_before_it_takes_the_place_and_its_folder_after(
    tmp_path, monkeypatch
):
    told = traced(monkeypatch)
    path = tmp_path / "new" / "folder" / "file"
    with replacing(path) as temporary:
        temporary.write_text("text")
    assert told == [
        ("sync", str(tmp_path / "new")),
        ("sync", str(tmp_path)),
        ("sync", str(temporary)),
        ("replace", str(path)),
        ("sync", str(path.parent)),
    ]


def test_what_killed_processes_left_is_removed_once_it_is_old(tmp_path):
    with started([sys.executable, "-c", ""]) as gone:
        pass
    mine = hidden_beside(tmp_path / "file")
    names = {
        "old": mine.name.replace(f"-{os.getpid()}-", f"-{gone.pid}-"),
        "young": mine.name.replace(f"-{os.getpid()}-", f"-{gone.pid}-").replace("-", "-", 1),
        "living": mine.name,
        "of another machine": mine.name.replace(mine.name.split("-")[2], "0" * 8),
        "somebody's": ".fpid_pin-notes.part",
    }
    names["young"] = names["young"][:-10] + "00000.part"
    for name in names.values():
        (tmp_path / name).write_text("")
    folder = tmp_path / (names["old"][:-10] + "11111.part")
    (folder / "deep").mkdir(parents=True)
    assert len(set(names.values())) == 5
    long_ago = time.time() - 2.0 * OLD
    for name, file in names.items():
        if name != "young":
            os.utime(tmp_path / file, (long_ago, long_ago))
    os.utime(folder, (long_ago, long_ago))
    write(tmp_path / "file", "text")
    left = {p.name for p in tmp_path.iterdir()}
    assert left == {"file"} | {file for name, file in names.items() if name != "old"}


def test_ctrl_c_waits_for_the_end_of_what_must_not_be_disturbed():
    order = []

    def work():
        with undisturbed():
            signal.raise_signal(signal.SIGINT)
            order.append("inside")
        order.append("never reached")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert order == ["inside"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_results_are_as_readable_as_other_files_and_nobody_sets_the_umask(tmp_path, monkeypatch):
    # For all threads of the process, even if only for a moment.
    monkeypatch.setattr(os, "umask", lambda mask: pytest.fail("the umask was set"))
    plain, plain_folder = tmp_path / "plain.txt", tmp_path / "plain"
    plain.write_text("")
    plain_folder.mkdir()
    write(tmp_path / "file.txt", "")
    with output_folder(tmp_path / "folder"):
        pass
    assert (tmp_path / "file.txt").stat().st_mode == plain.stat().st_mode
    assert (tmp_path / "folder").stat().st_mode == plain_folder.stat().st_mode


def test_a_private_umask_keeps_results_private(tmp_path):
    before = os.umask(0o077)
    try:
        write(tmp_path / "file.txt", "")
        with output_folder(tmp_path / "folder"):
            pass
    finally:
        os.umask(before)
    assert (tmp_path / "file.txt").stat().st_mode & 0o777 == 0o600
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o700
