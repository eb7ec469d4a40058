"""Text that came from a file or a user, made fit to be shown: visible, on one line, not too long.

Terminals obey control characters, and some characters turn a line around or hide what follows:
what is shown has them written out. What a message quotes may be as long as a file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any

__all__ = ["MOST", "cut", "differences", "listed", "named", "shown", "visible"]

#: Characters of a line in an error message, and of what it quotes.
MOST = 200
#: Characters of a name in a message, and names listed in one.
_NAME, _LISTED = 60, 3
_CUT = re.compile(r"\.\.\. \(\d+ characters\)$")
# What `str.isspace` takes for white space although it ends a line or is a control character.
_BREAKS = "".join(map(chr, (*range(9, 14), *range(28, 32), 0x85, 0x2028, 0x2029)))


def visible(text: str, keep: str = "") -> str:
    r"""Write out, as Python does (``\n``, ``\x1b``, ``\u202e``), what has no shape of its own.

    These are control and format characters, line separators, halves of surrogate pairs, and
    characters that Unicode does not know.

    Parameters
    ----------
    text
        Any text.
    keep
        Characters to leave as they are.
    """
    if text.isprintable():
        return text
    return "".join(c if c in keep or _has_shape(c) else _written_out(c) for c in text)


def _has_shape(character: str) -> bool:
    # Spaces of other widths count as unprintable; they do no harm.
    return character.isprintable() or (character.isspace() and character not in _BREAKS)


def _written_out(character: str) -> str:
    return character.encode("unicode_escape").decode("ascii")


def cut(text: str, most: int = MOST) -> str:
    """Return at most `most` characters of `text`; one that was cut says how long it is, or was."""
    if len(text) <= most:
        return text
    before = _CUT.search(text)
    tail = before.group() if before else f"... ({len(text)} characters)"
    return text[: max(most - len(tail), 0)] + tail


def shown(value: object, most: int = MOST) -> str:
    """Return what Python writes for `value`, visible, on one line and cut.

    Of a text the length is its own, without quotes. What cannot be written at all is described.
    """
    if isinstance(value, str) and len(value) > most:
        return cut(f"{value[:most]!r}... ({len(value)} characters)", most)
    try:
        text = repr(value)
    except RecursionError:
        return f"a {type(value).__name__} nested too deeply to be written"
    except ValueError:
        # Python refuses to write whole numbers of more than some thousand digits.
        return f"a {type(value).__name__} too long to be written"
    return cut(visible(text), most)


def named(name: object) -> str:
    """Return a name as messages quote it."""
    return shown(name, _NAME)


def listed(names: Iterable[object], write: Callable[[object], str] = named) -> str:
    """Return names as messages list them: the first few, each as `write` has it."""
    several = list(names)
    return ", ".join(map(write, several[:_LISTED])) + (", ..." if several[_LISTED:] else "")


def differences(there: Any, here: Any, path: str = "") -> list[str]:
    """Return how two plain tables differ: a line for each key, with its path and both values."""
    if isinstance(there, Mapping) and isinstance(here, Mapping):
        keys = sorted({*there, *here})
        pairs = [(key, there.get(key), here.get(key)) for key in keys]
        if there == here and list(there) != list(here):
            return [f"{path or 'keys'} in another order"]
    elif isinstance(there, list) and isinstance(here, list) and len(there) == len(here):
        pairs = [(k, *pair) for k, pair in enumerate(zip(there, here, strict=True))]
    elif there == here or (there != there and here != here):
        return []
    else:
        return [f"{path} is {named(there)} there and {named(here)} here"]
    dot = f"{path}." if path else ""
    return [line for key, one, two in pairs for line in differences(one, two, f"{dot}{key}")]
