"""Files that appear whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fpid_pin.exceptions import FileFormatError


@contextmanager
def replacing(path: str | Path) -> Iterator[Path]:
    """Give a temporary file beside `path` that replaces it when the block ends without an error.

    Folders on the way are made. After an error what was at `path` is still there.

    Raises
    ------
    FileFormatError
        Before the block: the folder cannot be written; after it: `path` is a folder itself.
    """
    path = Path(path)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        temporary = _reserve(path)
    except OSError as error:
        raise _unwritable(path, error) from None
    try:
        yield temporary
        try:
            os.replace(temporary, path)
        except OSError as error:
            raise _unwritable(path, error) from None
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise


def hidden_beside(path: Path, suffix: str) -> Path:
    """Return a name beside `path` that no other process will think of."""
    return path.parent / f".{path.name}.{secrets.token_hex(6)}{suffix}"


def _reserve(path: Path) -> Path:
    temporary = hidden_beside(path, ".part")
    # Opened by hand: `tempfile` makes files that only their owner may read, and a result is as
    # readable as any other new file. The kernel takes the umask off the mode, so nobody asks for
    # it (asking means setting it, for all threads).
    os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    return temporary


def _unwritable(path: Path, error: OSError) -> FileFormatError:
    return FileFormatError(f"{path}: cannot be written ({error.strerror})")
