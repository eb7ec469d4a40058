"""Files and folders that appear whole or not at all, and a lock on them.

What is new is written into a hidden folder beside its place, brought to the disk, and then moved
into its place in one step. A killed process leaves at most that hidden folder, ``.fpid_pin-*``.
"""

import errno
import hashlib
import os
import shutil
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory

from fpid_pin.exceptions import FileFormatError

#: By the letters that `ls -l` has for them.
_KINDS = {
    "-": "a file", "d": "a folder", "l": "a symlink", "p": "a FIFO", "s": "a socket",
    "c": "a device", "b": "a device",
}  # fmt: skip


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give the name of a temporary file that replaces `path` when the block ends without an error.

    Folders on the way are made. After an error what was at `path` is still there. What the system
    refuses, in the block too, is a FileFormatError.
    """
    path = Path(path)
    try:
        require_file(path)
        with hidden_folder(path) as folder:
            temporary = folder / path.name
            temporary.touch()
            yield temporary
            sync(temporary)
            require_file(path)
            os.replace(temporary, path)
        sync(path.parent)
    except OSError as error:
        raise unwritable(path, error) from None


@contextmanager
def hidden_folder(path: Path) -> Iterator[Path]:
    """Give a new folder beside `path`; it goes when the block ends, with all that is still in it.

    Files within it have the mode of any new file, as `tempfile`'s own do not.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    with TemporaryDirectory(
        prefix=f"{hidden_name(path)}-", dir=path.parent, ignore_cleanup_errors=True
    ) as name:
        yield Path(name)


@contextmanager
def locked(path: str | Path) -> Iterator[None]:
    """Keep other processes away from `path` for this block; however this process ends, it is free.

    What a killed process has left in hidden folders for `path` is removed, and so are folders made
    for it in which nothing was written.
    """
    # Imported late: most commands lock nothing.
    from filelock import FileLock, Timeout

    path = Path(path)
    place = path.parent / f"{hidden_name(path)}.lock"
    lock = FileLock(place, timeout=0)
    made = [folder for folder in path.parents if not folder.exists()]
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire()
    except Timeout:
        raise FileFormatError(
            f"{path}: expected to be alone with it, got another fpid-pin at work there"
        ) from None
    except OSError as error:
        raise unwritable(path, error) from None
    try:
        for abandoned in path.parent.glob(f"{hidden_name(path)}-*"):
            discard(abandoned)
        yield
    finally:
        with suppress(OSError):
            # While it is held: who waits for the lock looks whether its file is still there.
            place.unlink()
        lock.release()
        for folder in made:
            with suppress(OSError):  # it is not empty
                folder.rmdir()


def hidden_name(path: Path) -> str:
    """Return what hidden names that belong to `path` begin with; short, however long its name."""
    return f".fpid_pin-{hashlib.sha256(os.fsencode(path.name)).hexdigest()[:12]}"


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
    return _KINDS.get(stat.filemode(mode)[0], "something else")


def require_file(path: Path) -> None:
    """Refuse a place where a file of ours may not go.

    A link would be replaced and not what it points to; a device would be lost to the system.
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
    for path in (*folder.rglob("*"), folder):
        if not path.is_symlink():
            sync(path)


def discard(path: Path) -> None:
    """Remove a file or a folder, as far as the system lets us."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path, ignore_errors=True)
    else:
        with suppress(OSError):
            path.unlink(missing_ok=True)
