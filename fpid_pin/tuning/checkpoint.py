"""Checkpoints of a search: its arrays, its configuration, and the versions that made them."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import npz
from fpid_pin._version import __version__
from fpid_pin.exceptions import FpidError, FpidWarning, TuningError

KIND = "checkpoint"
_MOST_NAMED = 4


def versions() -> dict[str, str]:
    """Return the versions of what decides a search's bits."""
    import pinocchio
    import pymoo

    return {
        "fpid_pin": __version__,
        "pin": str(pinocchio.__version__),
        "numpy": np.__version__,
        "pymoo": str(pymoo.__version__),
    }


def plain(configuration: Mapping[str, Any]) -> Any:
    """Return a configuration as it will be read back from a file.

    Objects of a user's own appear as their repr; its address changes from process to process.
    """
    return json.loads(re.sub(r" at 0x[0-9a-fA-F]+", "", json.dumps(configuration)))


def write(
    path: Path, done: int, arrays: Mapping[str, Any], configuration: Mapping[str, Any]
) -> None:
    """Write a checkpoint after `done` generations in place of the last one, atomically.

    Raises
    ------
    FileFormatError
        The file cannot be written.
    """
    table = {"configuration": configuration, "done": done, "versions": versions()}
    npz.write(path, KIND, table, arrays)


def read(path: Path, configuration: Any) -> tuple[int, npz.Arrays]:
    """Return how many generations are done, and the arrays after them.

    Raises
    ------
    FileFormatError
        Damaged, or no checkpoint.
    TuningError
        Of another configuration; the line says what differs, there and here.

    Warns
    -----
    FpidWarning
        Other versions wrote it.
    """
    arrays, table = npz.read(path, KIND)
    agree(path, table, configuration)
    return int(table["done"]), arrays


def is_empty(path: Path) -> bool:
    """Return whether a file is a checkpoint of a search that has no generation yet."""
    try:
        return not npz.read(path, KIND)[1]["done"]
    except FpidError:
        return False


def agree(path: Path, meta: Mapping[str, Any], configuration: Any) -> None:
    """Refuse a checkpoint of another configuration; warn where the versions differ.

    Raises
    ------
    TuningError
        Naming what differs, the checkpoint's value and the present one.
    """
    found = _differences(meta["configuration"], configuration)
    if found:
        named = "; ".join(found[:_MOST_NAMED])
        more = f"; and {len(found) - _MOST_NAMED} more" if len(found) > _MOST_NAMED else ""
        raise TuningError(f"{path}: a checkpoint of another search: {named}{more}")
    old = _differences(meta["versions"], versions())
    if old:
        warnings.warn(
            f"{path}: written with other versions, so the last bits may differ: {'; '.join(old)}",
            FpidWarning,
            stacklevel=3,
        )


def _differences(then: Any, now: Any, path: str = "") -> list[str]:
    if isinstance(then, Mapping) and isinstance(now, Mapping):
        keys = sorted(then.keys() | now.keys())
        return [
            line
            for key in keys
            for line in _differences(
                then.get(key), now.get(key), f"{path}.{key}" if path else str(key)
            )
        ]
    if isinstance(then, list) and isinstance(now, list) and len(then) == len(now):
        return [
            line
            for k, (a, b) in enumerate(zip(then, now, strict=True))
            for line in _differences(a, b, f"{path}.{k}")
        ]
    same = then == now or (then != then and now != now)
    return [] if same else [f"{path} is {_brief(then)} there and {_brief(now)} here"]


def _brief(value: Any) -> str:
    text = "nothing" if value is None else repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
