"""Folders of results: whole or not at all, one process at a time, and never somebody else's."""

import errno
import os
import sys
from pathlib import Path

import pytest
from bounded import finished

from fpid_pin.cli.output import output_folder
from fpid_pin.exceptions import FileFormatError


def put(path, text):
    with output_folder(path) as folder:
        (folder / "result").write_text(text)
    return path


def test_a_folder_is_replaced_whole(tmp_path):
    path = tmp_path / "deep" / "out"
    with output_folder(path) as folder:
        (folder / "result").write_text("old")
        (folder / "stale").write_text("old")
    with output_folder(path) as folder:
        with pytest.raises(FileFormatError, match="got another fpid-pin at work there"):
            put(path, "second at once")
        (folder / "result").write_text("new")
    assert {p.name for p in path.iterdir()} == {".fpid_pin", "result"}
    assert (path / "result").read_text() == "new"
    assert [p.name for p in path.parent.iterdir()] == ["out"]
    # What came to lie there meanwhile is looked at again.
    with pytest.raises(FileFormatError, match="got another folder"), output_folder(tmp_path / "x"):
        (tmp_path / "x" / "thesis").mkdir(parents=True)
    assert {p.name for p in tmp_path.iterdir()} == {"deep", "x"}


def test_what_is_a_user_s_own_is_carried_over(tmp_path):
    path = put(tmp_path / "out", "old")
    (path / "notes.txt").write_text("mine")
    (path / "plots" / "deep").mkdir(parents=True)
    (path / "plots" / "deep" / "mine.svg").write_text("<svg/>")
    (path / "link").symlink_to("notes.txt")
    for text in ("new", "newer"):
        put(path, text)
        assert (path / "result").read_text() == text
        assert (path / "notes.txt").read_text() == "mine"
        assert (path / "plots" / "deep" / "mine.svg").read_text() == "<svg/>"
        assert (path / "link").readlink() == Path("notes.txt")
    with output_folder(path) as folder:
        (folder / "notes.txt").write_text("a result")
    # A name that is taken now: the user's is kept under another.
    assert (path / "notes.txt").read_text() == "a result"
    assert (path / "notes.txt.kept").read_text() == "mine"
    assert not (path / "result").exists()


def test_after_an_error_all_is_as_it_was(tmp_path):
    path = put(tmp_path / "out", "old")
    with pytest.raises(ZeroDivisionError), output_folder(path) as folder:
        (folder / "result").write_text(f"{1 // 0}")
    assert (path / "result").read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_everything_is_on_the_disk_before_the_swap_and_the_entry_after(tmp_path, monkeypatch):
    told, fsync, rename = [], os.fsync, os.rename
    path = put(tmp_path / "out", "old")

    def record(handle):
        told.append(Path(os.readlink(f"/proc/self/fd/{handle}")).name)
        fsync(handle)

    def swapped(old, new):
        told.append("swap")
        rename(old, new)

    monkeypatch.setattr(os, "fsync", record)
    monkeypatch.setattr(os, "rename", swapped)
    with output_folder(path) as folder:
        (folder / "inner").mkdir()
        (folder / "inner" / "deep").write_text("")
        hidden = folder.name
    assert set(told[:-3]) == {".fpid_pin", "inner", "deep", hidden}
    assert told[-3:] == ["swap", "swap", tmp_path.name]


def test_a_mount_point_is_refused(tmp_path):
    place = tmp_path / "disk"
    place.mkdir()
    if finished(["mount", "-t", "tmpfs", "-o", "size=1m", "tmpfs", str(place)]).returncode:
        pytest.skip("tmpfs may not be mounted here")
    try:
        (place / ".fpid_pin").write_text("")
        with pytest.raises(FileFormatError, match="got a mount point"):
            put(place, "new")
        put(place / "out", "new")
        assert (place / "out" / "result").read_text() == "new"
    finally:
        finished(["umount", str(place)], check=True)


@pytest.mark.parametrize("where", [".", "..", "/", "../here"])
def test_the_working_folder_is_refused(tmp_path, monkeypatch, where):
    here = put(tmp_path / "here", "old")
    monkeypatch.chdir(here)
    with pytest.raises(FileFormatError, match="got the working folder or one above it"):
        put(where, "new")
    assert (here / "result").read_text() == "old"


@pytest.mark.parametrize("kind", ["a symlink", "a file", "a FIFO", "another folder", "a device"])
def test_what_is_not_ours_is_left_alone(tmp_path, kind):
    path = tmp_path / "out"
    if kind == "a symlink":
        path.symlink_to(put(tmp_path / "real", "old"))
    elif kind == "a file":
        path.write_text("mine")
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a device":
        path = Path("/dev/null")
    else:
        path.mkdir()
        (path / "thesis").write_text("mine")
    before = path.lstat()
    work = []
    refused = pytest.raises(FileFormatError, match=f"expected a new folder .*, got {kind}")
    with refused, output_folder(path):
        work.append("begun")
    assert work == []
    assert path.lstat() == before


def test_a_refusal_of_the_system_names_the_results_and_not_the_hidden_folder(tmp_path):
    path = tmp_path / "out"
    with pytest.raises(FileFormatError) as caught, output_folder(path) as folder:
        (folder / "missing" / "file").write_text("")
    assert str(caught.value) == f"{path}: cannot be written (No such file or directory)"
    with pytest.raises(FileFormatError) as caught, output_folder(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(caught.value) == f"{path}: cannot be written (No space left on device)"
    with pytest.raises(FileFormatError) as caught, output_folder(path):
        raise OSError(errno.ENOENT, "No such file or directory", "mesh.stl")
    assert str(caught.value) == "mesh.stl: No such file or directory"
    # Not all that the system refuses is about files.
    with pytest.raises(BlockingIOError), output_folder(path):
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")
    assert list(tmp_path.iterdir()) == []


# One process that imports, and forks for each step: the child is killed at it.
KILLED = """
import os, signal, sys
from pathlib import Path
from fpid_pin.cli import output

root = Path(sys.argv[1])

def put(path, text, kill_at=None):
    with output.output_folder(path) as folder:
        for name in ("result", "other"):
            (folder / name).write_text(text)
        if kill_at is not None:
            count_down(kill_at)

def count_down(steps):
    # From here on each call of the system may be the last.
    def counted(call):
        def then(*arguments, **named):
            nonlocal steps
            if steps == 0:
                os.kill(os.getpid(), signal.SIGKILL)
            steps -= 1
            return call(*arguments, **named)
        return then

    for name in ("open", "fsync", "rename", "unlink", "rmdir", "lstat"):
        setattr(os, name, counted(getattr(os, name)))

step, killed = 0, True
while killed:
    path = root / f"{step}" / "out"
    put(path, "old")
    child = os.fork()
    if child == 0:
        put(path, "new", kill_at=step)
        os._exit(0)
    killed = os.waitpid(child, 0)[1] == signal.SIGKILL
    there = path.exists()
    # As the next command finds it.
    with output.output_folder(path):
        texts = {(path / name).read_text() for name in ("result", "other")}
    left = [p.name for p in path.parent.iterdir()]
    print(there, *texts, *left)
    step += 1
"""


def test_killed_at_any_step_of_the_swap_the_results_are_the_old_or_the_new(tmp_path):
    """And whoever comes next finds them, and nothing else."""
    done = finished([sys.executable, "-c", KILLED, str(tmp_path)], check=True)
    lines = done.stdout.splitlines()
    assert len(lines) > 20
    # Killed between two renames the old results have a hidden name, until the next command.
    assert set(lines) == {"True old out", "True new out", "False old out"}
    # Once the new are there they stay.
    assert lines[lines.index("True new out") :].count("True old out") == 0
