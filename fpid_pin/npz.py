"""Result files: a NumPy ``.npz`` of arrays and one JSON table, with a SHA-256 that shows damage.

Nothing in it is pickled, and `numpy.load` reads it without this package. The checksum is there
for damage, not for forgery: whoever can write the file can write a new checksum too.
"""

import csv
import hashlib
import json
import warnings
import zipfile
from collections.abc import Mapping
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.files import replacing
from fpid_pin.resources import needed
from fpid_pin.text import shown

Arrays = dict[str, NDArray[Any]]

#: Number of this file format.
FORMAT = 4
_TABLE, _CHECKSUM = "meta", "sha256"


def write(
    path: str | Path, kind: str, table: Mapping[str, Any], arrays: Mapping[str, Any], *,
    compressed: bool = False,
) -> None:  # fmt: skip
    """Write arrays of numbers or texts and a table of plain values, whole or not at all.

    `kind` says in words what the file is, and a reader asks for it. Compressed, arrays of float64
    are packed by pcodec, every bit kept.
    """
    members = {name: np.asarray(array) for name, array in arrays.items()}
    for name, array in members.items():
        if array.dtype.kind not in "fiuU":
            raise ArgumentError(name, "numbers or texts", array.dtype)
        if not name.isprintable() or set(name) & set("/\\") or name in (_TABLE, _CHECKSUM):
            raise ArgumentError("arrays", "names that a file can have", shown(name))
    head: dict[str, Any] = {"kind": kind, "format": FORMAT}
    if compressed:
        head["packed"] = {name: array.shape for name, array in members.items()}
        members = {name: _packed(array) for name, array in members.items()}
    members[_TABLE] = np.array(json.dumps(head | dict(table)))
    members[_CHECKSUM] = np.array(_checksum(members))
    with replacing(path) as temporary, open(temporary, "wb") as file:
        np.savez(file, **members)  # type: ignore[arg-type]


def read(path: str | Path, kind: str) -> tuple[Arrays, dict[str, Any]]:
    """Return the arrays and the table of a file; a fault's line names the file."""
    path = Path(path)
    if not path.is_file():
        found = f"expected a {kind}, got no file" if path.exists() else "no such file"
        raise FileFormatError(f"{path}: {found}")
    try:
        with zipfile.ZipFile(path) as zipped, warnings.catch_warnings():
            warnings.simplefilter("ignore")  # NumPy's, of headers that it can only guess
            return _contents(zipped, kind)
    except FpidError as error:
        raise type(error)(f"{path}: {error}") from None
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be read ({error.strerror or error})") from None
    except MemoryError:
        raise FileFormatError(f"{path}: does not fit into memory") from None
    except Exception as error:
        # A damaged file can be anything to zipfile, NumPy and json.
        reason = f"{type(error).__name__}: {error}"
        raise FileFormatError(
            f"{path}: expected a {kind}, got another file or a damaged one ({reason})"
        ) from None


def _contents(zipped: zipfile.ZipFile, kind: str) -> tuple[Arrays, dict[str, Any]]:
    members: Arrays = {}
    for info in zipped.infolist():
        with zipped.open(info) as file:
            array = np.lib.format.read_array(file, allow_pickle=False)
        members[info.filename.removesuffix(".npy")] = array
    if _CHECKSUM not in members or _TABLE not in members:
        raise FileFormatError(f"expected a {kind}, got a zip without a table and its checksum")
    if str(members.pop(_CHECKSUM)) != _checksum(members):
        raise FileFormatError(f"expected a {kind}, got a damaged one: its checksum is wrong")
    table = json.loads(str(members.pop(_TABLE)))
    found, number = table.pop("kind"), table.pop("format")
    if found != kind:
        raise FileFormatError(f"expected a {kind}, got a {found}")
    if number != FORMAT:
        raise FileFormatError(f"expected a {kind} of format {FORMAT}, got format {number}")
    shapes = table.pop("packed", None)
    if shapes is not None:
        members = {name: _unpacked(members[name], tuple(shape)) for name, shape in shapes.items()}
    return members, table


def _checksum(members: Mapping[str, NDArray[Any]]) -> str:
    """Return the SHA-256 over the names, types, shapes and bytes of arrays."""
    whole = hashlib.sha256()
    for name in sorted(members):
        array = members[name]
        whole.update(repr((name, array.dtype.str, array.shape)).encode())
        whole.update(array.tobytes())
    return whole.hexdigest()


def _packed(array: NDArray[Any]) -> NDArray[np.uint8]:
    """Return an array, (N,) or (N, n), as pcodec's bytes: one column after another."""
    codec = needed("pcodec", "compressed")
    columns = np.asarray(array, np.float64).T.reshape(-1)
    packed = codec.standalone.simple_compress(columns, codec.ChunkConfig())
    return np.frombuffer(packed, np.uint8)


def _unpacked(packed: NDArray[np.uint8], shape: tuple[int, ...]) -> NDArray[np.float64]:
    codec = needed("pcodec", "compressed")
    columns = np.empty(prod(shape))
    codec.standalone.simple_decompress_into(packed.tobytes(), columns)
    return np.ascontiguousarray(columns.reshape(shape[::-1]).T)


def write_columns(
    path: str | Path, table: Mapping[str, NDArray[Any]], *, parquet: bool = False,
    about: Mapping[str, Any] | None = None,
) -> Path:  # fmt: skip
    """Write a table by column as CSV, every digit, or as Parquet with its metadata `about`."""
    with replacing(path) as temporary:
        if parquet:
            arrow = needed("pyarrow", "parquet").table(dict(table))
            if about is not None:
                arrow = arrow.replace_schema_metadata({"fpid_pin": json.dumps(about)})
            needed("pyarrow.parquet", "parquet").write_table(arrow, temporary, compression="zstd")
        else:
            with open(temporary, "w", newline="", encoding="utf-8") as file:
                # Floats by their repr: the shortest text that is that number.
                writer = csv.writer(file, lineterminator="\n")
                writer.writerow(table)
                writer.writerows(zip(*(column.tolist() for column in table.values()), strict=True))
    return Path(path)
