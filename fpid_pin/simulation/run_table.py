"""The table that a run's file holds as JSON, where numbers may be inf and texts may say so.

JSON has no inf and no NaN: such numbers are written as the texts ``"inf"``, ``"-inf"``, ``"nan"``,
and a text that reads the same is written as ``{"$text": "inf"}``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

#: Deeper than any description, and than any of its kin in other files.
MOST_LEVELS = 100
#: Memory that a table may take beyond twice its text in a file [bytes].
MOST_MEMORY = 100_000_000
_SPELT = ("inf", "-inf", "nan")
_TEXT = "$text"
# Always texts, also in files written before texts were told apart from numbers.
_NAMES = ("name", "kind", "joint")


def to_json(table: Mapping[str, Any]) -> str:
    """Return a table of plain values as strict JSON."""
    return json.dumps(_spelt(table), allow_nan=False)


def from_json(text: str) -> Any:
    """Return what `to_json` was given, tuples as lists.

    Raises
    ------
    ValueError
        Not JSON, or such as no table of ours is: nested deeply, much larger in memory than as a
        text, with numbers beyond a float's range or texts that are none.
    """
    # An empty list takes 2 characters of text and 64 bytes; numbers take less than their digits.
    memory = 72 * text.count("[") + 250 * text.count("{") + 32 * text.count(",")
    if memory > MOST_MEMORY + 8 * len(text):
        raise ValueError("a table too large for its text")
    try:
        return _read(json.loads(text), MOST_LEVELS)
    except RecursionError:
        raise ValueError("a table nested too deeply") from None


def _spelt(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return str(value)
    if isinstance(value, str) and value in _SPELT:
        return {_TEXT: value}
    if isinstance(value, Mapping):
        return {key: _spelt(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_spelt(item) for item in value]
    return value


def _read(value: Any, levels: int) -> Any:
    """Read spelt numbers and texts; in place, since a table may be large."""
    if isinstance(value, str):
        value.encode()  # half a surrogate pair is no text, and cannot be printed
        return float(value) if value in _SPELT else value
    if isinstance(value, int) and value.bit_length() > 1023:
        raise ValueError("a number beyond the range of floats")
    if levels == 0 and isinstance(value, (dict, list)):
        raise ValueError("a table nested too deeply")
    if isinstance(value, dict):
        if list(value) == [_TEXT]:
            return value[_TEXT]
        for key, item in value.items():
            key.encode()
            if not (key in _NAMES and isinstance(item, str)):
                value[key] = _read(item, levels - 1)
            else:
                item.encode()
    elif isinstance(value, list):
        value[:] = (_read(item, levels - 1) for item in value)
    return value
