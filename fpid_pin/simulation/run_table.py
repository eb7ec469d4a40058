"""The table that a run's file holds as JSON, where numbers may be inf and texts may say so.

JSON has no inf and no NaN: such numbers are written as the texts ``"inf"``, ``"-inf"``, ``"nan"``,
and a text that reads the same is written as ``{"$text": "inf"}``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

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
        Not JSON.
    """
    return _read(json.loads(text))


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


def _read(value: Any) -> Any:
    if isinstance(value, str):
        return float(value) if value in _SPELT else value
    if isinstance(value, dict):
        if list(value) == [_TEXT]:
            return value[_TEXT]
        return {
            key: item if key in _NAMES and isinstance(item, str) else _read(item)
            for key, item in value.items()
        }
    if isinstance(value, list):
        return [_read(item) for item in value]
    return value
