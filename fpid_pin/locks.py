"""One process at a time on a file or a folder."""

from __future__ import annotations

import fcntl
import os
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from fpid_pin.exceptions import FileFormatError, FpidWarning
from fpid_pin.files import key_of, make_folder, undisturbed, unwritable


@contextmanager
def locked(path: str | Path) -> Iterator[None]:
    """Keep `path` for this block; the system lets go of it however this process ends.

    The lock is a hidden file beside `path`, which is itself replaced again and again. It goes with
    the block; one that a killed process left is taken over.

    Raises
    ------
    FileFormatError
        Another block, of this process or another, has it; or its folder cannot be written.

    Warns
    -----
    FpidWarning
        A file system that knows no locks: the block goes on without.
    """
    path = Path(path)
    lock = path.parent / f".fpid_pin-{key_of(path)}.lock"
    handle: int | None = None
    try:
        try:
            make_folder(path.parent)
            with undisturbed():
                handle = _take(path, lock)
        except OSError as error:
            raise unwritable(path, error) from None
        yield
    finally:
        if handle is not None:
            with suppress(OSError):
                # First the name, then the lock: whoever waits for it finds another file there.
                lock.unlink()
            os.close(handle)


def _take(path: Path, lock: Path) -> int:
    while True:
        handle = os.open(lock, os.O_CREAT | os.O_RDWR | os.O_NOFOLLOW, 0o666)
        try:
            _hold(path, handle)
            if _is(handle, lock):
                with suppress(OSError):  # on a full disk it is a lock without a name
                    os.ftruncate(handle, 0)
                    os.pwrite(handle, str(os.getpid()).encode(), 0)
                return handle
        except BaseException:
            os.close(handle)
            raise
        # Its last owner removed it while we opened it.
        os.close(handle)


def _hold(path: Path, handle: int) -> None:
    try:
        # Of this opened file, not of the process: two threads exclude each other as well.
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        holder = os.pread(handle, 20, 0).decode("ascii", "replace")
        raise FileFormatError(
            f"{path}: expected to be alone with it, got another fpid-pin at work there"
            + (f" (process {holder})" if holder.isdecimal() else "")
        ) from None
    except OSError as error:
        warnings.warn(
            f"{path}: cannot be locked ({error.strerror}); leave it to one process at a time",
            FpidWarning,
            stacklevel=5,
        )


def _is(handle: int, path: Path) -> bool:
    """Return whether an open file is still the one that `path` names."""
    try:
        there = os.stat(path, follow_symlinks=False)
    except FileNotFoundError:
        return False
    mine = os.fstat(handle)
    return (there.st_dev, there.st_ino) == (mine.st_dev, mine.st_ino)
