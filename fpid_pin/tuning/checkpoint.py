"""Checkpoints of a search: arrays and a JSON text, nothing pickled, whole or not at all."""

from __future__ import annotations

import hashlib
import json
import re
import warnings
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import FileFormatError, FpidWarning, TuningError
from fpid_pin.files import replacing

FORMAT = 1
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
    """Return a configuration as it will be read back from JSON.

    Objects of a user's own appear as their repr; its address changes from process to process.
    """
    text = json.dumps(configuration)
    return json.loads(re.sub(r" at 0x[0-9a-fA-F]+", "", text))


def write(path: Path, arrays: Mapping[str, Any], meta: Mapping[str, Any]) -> None:
    """Write a checkpoint in place of the last one, atomically.

    Raises
    ------
    FileFormatError
        The folder cannot be written.
    """
    meta = dict(meta) | {"format": FORMAT, "versions": versions()}
    text = json.dumps(meta, sort_keys=True)
    with replacing(path) as temporary:
        try:
            with open(temporary, "wb") as file:
                np.savez(
                    file, meta=np.array(text), digest=np.array(_digest(text, arrays)), **arrays
                )
        except OSError as error:
            raise FileFormatError(f"{path}: cannot be written ({error.strerror})") from None


def read(path: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return the arrays and the meta table of a checkpoint.

    Raises
    ------
    FileFormatError
        Cut short, altered, of another format, or not a checkpoint.
    """
    try:
        # Opened here: numpy leaves its own file open where the archive turns out to be broken.
        with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
            arrays = {name: file[name] for name in file.files}
        text, digest = str(arrays.pop("meta")), str(arrays.pop("digest"))
        meta = json.loads(text)
        found = meta["format"]
    except OSError as error:
        raise FileFormatError(f"{path}: {error.strerror or 'cannot be read'}") from None
    except (zipfile.BadZipFile, KeyError, ValueError, TypeError, EOFError, AttributeError):
        raise FileFormatError(
            f"{path}: expected a checkpoint, got something else or one that is cut short"
        ) from None
    if found != FORMAT:
        raise FileFormatError(f"{path}: expected checkpoint format {FORMAT}, got {found!r}")
    if _digest(text, arrays) != digest:
        raise FileFormatError(f"{path}: expected an unaltered checkpoint, got one that was changed")
    return arrays, meta


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


def _digest(text: str, arrays: Mapping[str, Any]) -> str:
    whole = hashlib.sha256(text.encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        whole.update(f"{name} {array.dtype.str} {array.shape}".encode())
        whole.update(array.tobytes())
    return whole.hexdigest()
