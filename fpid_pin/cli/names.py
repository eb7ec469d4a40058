"""File names for what people have named: names are shown, files are told apart by them."""

from __future__ import annotations

import unicodedata
from collections.abc import Collection, Sequence

from fpid_pin.exceptions import ConfigError

#: Bytes that the usual file systems give a name.
MOST_BYTES = 255
#: The longest ending of a file.
_ENDING = len(".npz")


def slug(name: str) -> str:
    """Return the letters and digits of a name, small, with single hyphens for all else."""
    # One form of each letter: some file systems take two forms of it for one name.
    text = unicodedata.normalize("NFC", name.lower())
    kept = "".join(c if c.isalnum() else "-" for c in text)
    return "-".join(part for part in kept.split("-") if part)


def file_names(
    labels: Sequence[Sequence[str]], *, prefix: str = "", taken: Collection[str] = ()
) -> list[str]:
    """Return a file name of its own, without ending, for each label.

    Parameters
    ----------
    labels
        Their parts: condition and controller, for example.
    prefix
        What all begin with.
    taken
        Names that are given already.

    Raises
    ------
    ConfigError
        A name that no file can have, for its length.

    Examples
    --------
    >>> file_names([["PID +"], ["PID -"], ["tuned"]], taken=["tuned"])
    ['pid', 'pid-2', 'tuned-2']
    """
    given = set(taken)
    names = []
    for label in labels:
        stem = prefix + ("-".join(filter(None, map(slug, label))) or "run")
        name, number = stem, 1
        while name in given:
            number += 1
            name = f"{stem}-{number}"
        size = len(name.encode()) + _ENDING
        if size > MOST_BYTES:
            parts = ", ".join(f"{part[:40]!r}{'...' * (len(part) > 40)}" for part in label)
            raise ConfigError(
                f"{parts}: expected a name that makes a file's, of {MOST_BYTES} bytes at most, "
                f"got {size}"
            )
        given.add(name)
        names.append(name)
    return names
