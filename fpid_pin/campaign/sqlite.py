"""What SQLite refuses, in one line that a user can act on."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from fpid_pin.exceptions import FileFormatError, FpidError

#: How long somebody else's lock is waited for [s].
PATIENCE = 5.0


@contextmanager
def told(path: Path) -> Iterator[None]:
    """Turn an error of SQLite into a line about a ledger; what was committed to it stays.

    Raises
    ------
    FileFormatError
        No SQLite file, a locked one, a full disk, damage.
    """
    try:
        yield
    except sqlite3.Error as error:
        # Of extended codes the lowest byte says the kind.
        code = getattr(error, "sqlite_errorcode", 0) & 0xFF
        if code == sqlite3.SQLITE_NOTADB:
            text = "expected a campaign's ledger, got a file that is no SQLite"
        elif code in (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED):
            text = f"another program has locked it ({PATIENCE:g} s waited)"
        elif code == sqlite3.SQLITE_FULL:
            text = "cannot be written (the disk is full); what was recorded stays"
        elif code in (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY):
            text = f"cannot be read or written ({error}); what was recorded stays"
        else:
            text = f"expected a sound ledger, got SQLite's complaint: {error}"
        raise FileFormatError(f"{path}: {text}") from None
    except FpidError:
        raise
    except (ValueError, TypeError, KeyError) as error:
        raise FileFormatError(f"{path}: expected a sound ledger, got {error!r}") from None


def quoted(label: str) -> str:
    """Return a column's name as SQL has it."""
    return '"' + label.replace('"', '""') + '"'
