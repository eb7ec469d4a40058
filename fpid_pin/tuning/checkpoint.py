"""Checkpoints of a search: arrays and a JSON text, nothing pickled, whole or not at all."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import checks, sealed
from fpid_pin._version import __version__
from fpid_pin.archive import Member
from fpid_pin.exceptions import FileFormatError, FpidWarning, TuningError
from fpid_pin.files import replacing
from fpid_pin.simulation.run_table import from_json, to_json

FORMAT = 2
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
    return from_json(re.sub(r" at 0x[0-9a-fA-F]+", "", to_json(configuration)))


def write(path: Path, arrays: Mapping[str, Any], meta: Mapping[str, Any]) -> None:
    """Write a checkpoint in place of the last one, atomically.

    Raises
    ------
    FileFormatError
        The file cannot be written.
    """
    text = to_json(dict(meta) | {"versions": versions()})
    with replacing(path) as temporary, open(temporary, "wb") as file:
        sealed.write(file, KIND, FORMAT, text, arrays)


def read(
    path: Path, expect: Callable[[dict[str, Any], Mapping[str, Member]], None]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arrays and the meta table of a checkpoint.

    Parameters
    ----------
    path
        The file.
    expect
        Called with the meta table and with types and shapes of the arrays before these are read;
        raises an `FpidError` for what it does not accept.

    Raises
    ------
    FileFormatError
        See `sealed.read`.
    """

    def table_of(text: str, members: Mapping[str, Member]) -> dict[str, Any]:
        try:
            meta = from_json(text)
        except ValueError as error:
            raise FileFormatError(f"meta: expected the table of a search, got {error}") from None
        checks.instance("meta", meta, dict, "the table of a search")
        for name in ("configuration", "versions"):
            checks.instance(f"meta.{name}", meta.get(name), dict, "a table")
        checks.integer("meta.done", meta.get("done"), low=0)
        expect(meta, members)
        return dict(meta)

    return sealed.read(path, KIND, (FORMAT,), table_of)


def is_empty(path: Path) -> bool:
    """Return whether a file is a checkpoint of a search that has no generation yet."""

    def none(meta: dict[str, Any], members: Mapping[str, Member]) -> None:
        if meta["done"] or members:
            raise FileFormatError("a generation is done")

    try:
        read(path, none)
    except FileFormatError:
        return False
    return True


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
