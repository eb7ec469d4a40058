"""Files and folders of results: whole or not at all, one process at a time, nobody else's."""

import errno
import os
import signal
import socket
import subprocess
import sys
from pathlib import Path

import pytest
from bounded import finished, started

from fpid_pin.cli.output import output_folder
from fpid_pin.exceptions import FileFormatError
from fpid_pin.files import hidden_folder, locked, replacing

both = pytest.mark.parametrize("block", [replacing, output_folder])


def inside(path):
    """Return the file of results: within a folder of them, or itself."""
    return path / "result" if path.is_dir() else path


def put(path, text, block=output_folder):
    with block(path) as temporary:
        inside(temporary).write_text(text)
    return path


@both
def test_what_is_there_is_replaced_whole_at_the_end_of_the_block(tmp_path, block):
    path = put(tmp_path / "deep" / "out", "old", block)
    with block(path) as temporary:
        inside(temporary).write_text("new")
        assert inside(path).read_text() == "old"
    assert inside(path).read_text() == "new"
    assert [p.name for p in path.parent.iterdir()] == ["out"]


@both
def test_an_error_in_the_block_leaves_what_was_there_and_nothing_else(tmp_path, block):
    path = put(tmp_path / "out", "old", block)
    with pytest.raises(TypeError), block(path) as temporary:
        # Fails once the file is there.
        inside(temporary).write_text(None)
    assert inside(path).read_text() == "old"
    assert [p.name for p in tmp_path.iterdir()] == ["out"]


def test_a_folder_keeps_nothing_of_the_old_results_and_is_written_by_one_at_a_time(tmp_path):
    path = tmp_path / "out"
    with output_folder(path) as folder:
        (folder / "stale").write_text("old")
    with output_folder(path) as folder:
        with pytest.raises(FileFormatError, match="got another fpid-pin at work there"):
            put(path, "second at once")
        (folder / "result").write_text("new")
    assert {p.name for p in path.iterdir()} == {".fpid_pin", "result"}


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


def made(kind, path):
    """Make what is none of ours at a path; return the path, or a device's."""
    if kind == "a symlink":
        path.with_name("elsewhere").write_text("mine")
        path.symlink_to("elsewhere")
    elif kind == "a FIFO":
        os.mkfifo(path)
    elif kind == "a socket":
        with socket.socket(socket.AF_UNIX) as server:
            server.bind(os.path.relpath(path))
    elif kind == "a file":
        path.write_text("mine")
    elif kind == "a device":
        return Path("/dev/null")
    else:
        path.mkdir()
        (path / "thesis").write_text("mine")
    return path


FOREIGN = ["a symlink", "a FIFO", "a socket", "a device"]


@pytest.mark.parametrize(
    ("block", "kind"),
    [(replacing, kind) for kind in (*FOREIGN, "a folder")]
    + [(output_folder, kind) for kind in (*FOREIGN, "a file", "another folder")],
)
def test_what_is_not_ours_is_never_replaced(tmp_path, monkeypatch, block, kind):
    monkeypatch.chdir(tmp_path)
    path = made(kind, tmp_path / "target")
    before, others = path.lstat(), sorted(tmp_path.iterdir())
    refused = pytest.raises(FileFormatError, match=f"expected a (regular|new) .*, got {kind}")
    with refused, block(path):
        pytest.fail("work began")
    assert path.lstat() == before
    assert sorted(tmp_path.iterdir()) == others


@both
def test_what_became_of_the_place_meanwhile_is_looked_at_again(tmp_path, block):
    path = tmp_path / "target"
    with pytest.raises(FileFormatError, match="got a symlink"), block(path):
        made("a symlink", path)
    assert path.read_text() == "mine"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["elsewhere", "target"]


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


@both
def test_a_name_may_be_as_long_as_the_system_allows(tmp_path, block):
    put(tmp_path / ("a" * 255), "text", block)
    with pytest.raises(FileFormatError, match="File name too long"):
        put(tmp_path / ("a" * 256), "text", block)
    assert [p.name for p in tmp_path.iterdir()] == ["a" * 255]


@both
def test_a_refusal_of_the_system_in_the_block_is_one_line_and_names_the_results(tmp_path, block):
    path = tmp_path / "out"
    with pytest.raises(FileFormatError) as caught, block(path):
        raise OSError(errno.ENOSPC, "No space left on device")
    assert str(caught.value) == f"{path}: cannot be written (No space left on device)"
    with pytest.raises(FileFormatError) as caught, block(path) as temporary:
        (temporary / "missing" / "file").write_text("")
    assert str(caught.value).startswith(f"{path}: cannot be written (No")
    assert list(tmp_path.iterdir()) == []


def test_a_refusal_that_is_not_of_a_folder_s_results_is_told_as_it_is(tmp_path):
    with pytest.raises(FileFormatError) as caught, output_folder(tmp_path / "out"):
        raise OSError(errno.ENOENT, "No such file or directory", "mesh.stl")
    assert str(caught.value) == "mesh.stl: No such file or directory"
    # Not all that the system refuses is about files.
    with pytest.raises(BlockingIOError), output_folder(tmp_path / "out"):
        raise BlockingIOError(errno.EAGAIN, "Resource temporarily unavailable")


@both
def test_all_is_on_the_disk_before_it_takes_its_place_and_the_entry_after(
    tmp_path, monkeypatch, block
):
    told, fsync = [], os.fsync
    path = put(tmp_path / "out", "old", block)

    def record(handle):
        told.append(os.fstat(handle).st_ino)
        fsync(handle)

    for name in ("rename", "replace"):
        move = getattr(os, name)
        monkeypatch.setattr(os, name, lambda *a, move=move: told.append("moved") or move(*a))
    monkeypatch.setattr(os, "fsync", record)
    with block(path) as temporary:
        if temporary.is_dir():
            (temporary / "inner").mkdir()
            (temporary / "inner" / "deep").write_text("")
    first = told.index("moved")
    assert set(told[:first]) == {p.stat().st_ino for p in (path, *path.rglob("*"))}
    moves = 2 if block is output_folder else 1  # the old one away, the new one there
    assert told[first:] == ["moved"] * moves + [tmp_path.stat().st_ino]


@pytest.mark.parametrize("mask", [0o022, 0o077])
def test_results_are_as_readable_as_other_files(tmp_path, monkeypatch, mask):
    before = os.umask(mask)
    try:
        # For all threads of the process, even if only for a moment.
        with monkeypatch.context() as patch:
            patch.setattr(os, "umask", lambda mask: pytest.fail("the umask was set"))
            put(tmp_path / "file.txt", "", replacing)
            put(tmp_path / "folder", "")
    finally:
        os.umask(before)
    assert (tmp_path / "file.txt").stat().st_mode & 0o777 == 0o666 & ~mask
    assert (tmp_path / "folder").stat().st_mode & 0o777 == 0o777 & ~mask


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
    assert list(tmp_path.iterdir()) == []  # the folder was made for the lock
    path.parent.write_text("")
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
