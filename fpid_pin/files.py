"""Files and folders that appear whole or not at all, power loss included.

What is new is written under a hidden name beside its place, brought to the disk, and then takes the
place in one step; the folder's own entry is brought to the disk last. Hidden names say whose they
are, so that what a killed process left behind can be told from what a living one is writing.
"""

from __future__ import annotations

import errno
import hashlib
import os
import re
import secrets
import shutil
import signal
import stat
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import FileFormatError

#: A hidden name older than this [s] whose process is gone has been abandoned.
OLD = 600.0
_KINDS = {
    stat.S_IFDIR: "a folder",
    stat.S_IFREG: "a file",
    stat.S_IFLNK: "a symlink",
    stat.S_IFIFO: "a FIFO",
    stat.S_IFSOCK: "a socket",
    stat.S_IFCHR: "a device",
    stat.S_IFBLK: "a device",
}
# A process id means something on its own machine only.
_HOST = hashlib.sha256(os.uname().nodename.encode()).hexdigest()[:8]
_HIDDEN = re.compile(r"\.fpid_pin-[0-9a-f]{12}-([0-9a-f]{8})-([1-9]\d{0,8})-[0-9a-f]{12}\.part")


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary file that replaces `path` when the block ends without an error.

    Folders on the way are made. After an error what was at `path` is still there, and nothing else.

    Raises
    ------
    FileFormatError
        `path` is neither absent nor a regular file (told before the block, and looked at again
        after it), or the system refuses (a full disk, no permission), in the block too.
    """
    path = Path(path)
    temporary: Path | None = None
    try:
        require_file(path)
        make_folder(path.parent)
        sweep(path.parent)
        with undisturbed():
            temporary = _reserve(path)
        yield temporary
        sync(temporary)
        require_file(path)
        with undisturbed():
            os.replace(temporary, path)
            temporary = None
        sync(path.parent)
    except OSError as error:
        raise unwritable(path, error) from None
    finally:
        if temporary is not None:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)


# ---------------------------------------------------------------------- what may be replaced


def put_text(path: str | Path, text: str) -> Path:
    """Write a text that appears whole or not at all, and return its path; see `replacing`."""
    path = Path(path)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def kind_of(path: Path) -> str | None:
    """Return what is at `path` ("a file", "a symlink", ...), not followed; None: nothing."""
    try:
        mode = os.lstat(path).st_mode
    except (FileNotFoundError, NotADirectoryError):
        return None
    return _KINDS.get(stat.S_IFMT(mode), "something else")


def require_file(path: Path) -> None:
    """Refuse a place where a file of ours may not go.

    A link would be replaced and not what it points to; a device would be lost to the system.

    Raises
    ------
    FileFormatError
        There is something, and it is not a regular file.
    """
    try:
        kind = kind_of(path)
    except OSError as error:
        raise unwritable(path, error) from None
    if kind not in (None, "a file"):
        raise FileFormatError(
            f"{path}: cannot be written: expected a regular file or none, got {kind}"
        )


def unwritable(path: Path, error: OSError) -> FileFormatError:
    """Return the error that says in one line why `path` cannot be written."""
    return FileFormatError(f"{path}: cannot be written ({error.strerror or error})")


# ---------------------------------------------------------------------- onto the disk


def sync(path: Path) -> None:
    """Bring a file's contents, or a folder's entries, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    except OSError as error:
        # Some network file systems know no such thing for a folder.
        if error.errno not in (errno.EINVAL, errno.ENOTSUP):
            raise
    finally:
        os.close(handle)


def sync_tree(folder: Path) -> None:
    """Bring a folder with all that is in it to the disk."""
    for place, _, names in os.walk(folder, onerror=_complain):
        for name in names:
            sync(Path(place, name))
        sync(Path(place))


def _complain(error: OSError) -> None:
    raise error


def make_folder(folder: Path) -> None:
    """Make a folder and those above it that are missing, to last."""
    missing = [folder]
    while not missing[-1].exists() and missing[-1] != missing[-1].parent:
        missing.append(missing[-1].parent)
    folder.mkdir(parents=True, exist_ok=True)
    for above in missing[1:]:
        sync(above)


@contextmanager
def undisturbed() -> Iterator[None]:
    """Let Ctrl-C wait until the block, a short one, has ended."""
    # Python hears signals in its main thread only. Masking the signal would not do: the system
    # would then hand it to another thread, and Python to this one all the same.
    main = threading.current_thread() is threading.main_thread()
    before = signal.getsignal(signal.SIGINT) if main else None
    if not callable(before):
        yield
        return
    heard: list[Any] = []
    signal.signal(signal.SIGINT, lambda *_: heard.append(_))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if heard:
            signal.raise_signal(signal.SIGINT)


# ---------------------------------------------------------------------- hidden names


def key_of(path: Path) -> str:
    """Return twelve letters for a name, however long it is."""
    return hashlib.sha256(os.fsencode(path.name)).hexdigest()[:12]


def hidden_beside(path: Path) -> Path:
    """Return a name beside `path` that no other process will think of."""
    # Of a length of its own: a name as long as the system allows has one too.
    whose = f"{key_of(path)}-{_HOST}-{os.getpid()}-{secrets.token_hex(6)}"
    return path.parent / f".fpid_pin-{whose}.part"


def sweep(folder: Path) -> None:
    """Remove what processes of this machine that are gone have left under hidden names."""
    # What cannot be looked at or removed is somebody else's, or gone by now.
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            named = _HIDDEN.fullmatch(entry.name)
            if named is None or named[1] != _HOST or _lives(int(named[2])):
                continue
            with suppress(OSError):
                if time.time() - entry.stat(follow_symlinks=False).st_mtime > OLD:
                    discard(Path(entry.path))


def discard(path: Path) -> None:
    """Remove a file or a folder, as far as the system lets us."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)


def _lives(process: int) -> bool:
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True  # another user's
    return True


def _reserve(path: Path) -> Path:
    temporary = hidden_beside(path)
    # Opened by hand: `tempfile` makes files that only their owner may read, and a result is as
    # readable as any other new file. The kernel takes the umask off the mode, so nobody asks for
    # it (asking means setting it, for all threads).
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return temporary
