"""Ways of damaging a sealed file, and of making one that lies."""

import io
import json
import random
import struct
import zipfile
import zlib

import numpy as np

from fpid_pin import sealed


def shell_of(data):
    """Return the positions of all bytes that are not an array's data: headers, list, directory."""
    places, at = [], 0
    while data[at : at + 4] == b"PK\x03\x04":
        size, name, extra = struct.unpack("<IHH", data[at + 22 : at + 30])
        start = at + 30 + name + extra
        heading = 10 + int.from_bytes(data[start + 8 : start + 10], "little")
        if data[at + 30 : at + 30 + name] == b"members.npy":
            heading = size
        places += range(at, start + heading)
        at = start + size
    return places + list(range(at, len(data)))


def structured(data, other, chance):
    """Return a mutation of a file's bytes: something was cut, moved, repeated or overwritten."""
    a, b = sorted(chance.sample(range(len(data)), 2))
    size = chance.choice((1, 2, 4, 8, 64, 512))
    kinds = {
        "cut": lambda: data[:a],
        "beheaded": lambda: data[a:],
        "hole": lambda: data[:a] + data[b:],
        "longer": lambda: data + bytes(size),
        "before": lambda: bytes(size) + data,
        "zeros": lambda: data[:a] + bytes(min(size, len(data) - a)) + data[a + size :],
        "ones": lambda: data[:a] + b"\xff" * min(size, len(data) - a) + data[a + size :],
        "noise": lambda: data[:a] + chance.randbytes(size) + data[a + size :],
        "repeated": lambda: data[:b] + data[a:],
        "swapped": lambda: data[:a] + data[b : b + size] + data[a + size : b] + data[a : a + size]
        + data[b + size :],
        "another's": lambda: data[:a] + other[a : a + size] + data[a + size :],
        "another's end": lambda: data[:a] + other[a:],
        "size": lambda: with_size(data, chance),
    }  # fmt: skip
    kind = chance.choice(sorted(kinds))
    return kind, kinds[kind]()


def with_size(data, chance):
    """Return a file one of whose headers or whose end has an absurd size or position."""
    at = chance.choice([k for k in range(len(data) - 4) if data[k : k + 2] == b"PK"])
    field = at + chance.choice((10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 42))
    value = chance.choice((0, 1, 0xFFFF, 0x7FFFFFFF, 0xFFFFFFFE, 0xFFFFFFFF))
    changed = bytearray(data)
    changed[field : field + 4] = struct.pack("<I", value)
    return bytes(changed[: len(data)])


def unsealed(data):
    """Return kind, format, table and arrays of a sealed file, by NumPy alone."""
    with np.load(io.BytesIO(data)) as file:
        arrays = {name: file[name] for name in file.files}
    listed = json.loads(arrays.pop("members").item())
    return listed["kind"], listed["format"], json.loads(str(arrays.pop("meta"))), arrays


def sealed_again(kind, number, text, arrays):
    file = io.BytesIO()
    sealed.write(file, kind, number, text, arrays)
    return file.getvalue()


NASTY = (
    0, -1, 1, 2, 0.5, -0.0, 1e-320, 1e6, 1e300, "inf", "-inf", "nan", True, None, "", "x",
    "\x1b[2J", "a\nb", "<script>", [], {}, [[]], [1.0, "x"], {"kind": "custom"}, 1 << 63,
    -(1 << 70), 10**300, "../../etc/passwd", "/dev/zero", "\x00", [0.0] * 50,
)  # fmt: skip


def nasty(value, chance):
    """Return what no honest writer puts in the place of `value`."""
    kind = random.Random.choice(chance, ("any", "any", "number", "drop"))
    if kind == "number" and isinstance(value, (int, float)) and not isinstance(value, bool):
        return chance.choice((-value, value * 1e9, value + 0.5, value * 1e-9, int(value) + 1))
    return chance.choice(NASTY)


def paths_of(table, path=()):
    yield path
    if isinstance(table, (dict, list)):
        pairs = table.items() if isinstance(table, dict) else enumerate(table)
        for key, value in pairs:
            yield from paths_of(value, (*path, key))


def lying(data, chance):
    """Return a file whose seal is right and whose contents are not, and what was changed."""
    kind, number, table, arrays = unsealed(data)
    if chance.random() < 0.7:
        path = chance.choice([p for p in paths_of(table) if p])
        inner = table
        for key in path[:-1]:
            inner = inner[key]
        if chance.random() < 0.2:
            del inner[path[-1]]
        elif chance.random() < 0.1 and isinstance(inner, dict):
            inner[chance.choice(("self", "kind", "x", "changes", "path", "name"))] = 1
        else:
            inner[path[-1]] = nasty(inner[path[-1]], chance)
        what = ".".join(map(str, path))
    else:
        what = chance.choice(sorted(arrays))
        arrays[what] = misshapen(arrays[what], chance)
        if arrays[what] is None:
            del arrays[what]
    try:
        return what, sealed_again(kind, number, json.dumps(table), arrays)
    except (ValueError, OverflowError):  # not even this writer does it
        return what, data


def misshapen(array, chance):
    flat = array.reshape(-1)
    return chance.choice((
        lambda: None, lambda: flat, lambda: array[:-1], lambda: array.T, lambda: array[..., None],
        lambda: array.astype(str), lambda: np.zeros((0, 2)), lambda: np.zeros(()),
        lambda: np.full(array.shape, np.nan), lambda: np.full(array.shape, 1e300),
        lambda: np.zeros(array.shape, int), lambda: np.array("[" * 2000),
        lambda: np.zeros((*array.shape, 0)),
    ))()  # fmt: skip


def repacked(data):
    """Yield what tools for zips and NumPy make of a file: the same members, other bytes."""
    with zipfile.ZipFile(io.BytesIO(data)) as zipped:
        members = {name: zipped.read(name) for name in zipped.namelist()}
    for method in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED, zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA):
        for order in (list(members), sorted(members), list(members)[::-1]):
            yield f"zip {method}", zip_of({name: members[name] for name in order}, method)
    _, _, _, arrays = unsealed(data)
    for save in (np.savez, np.savez_compressed):
        for more in ({}, {"members": np.array(b"{}")}, {"members": np.array([b"{}"])}):
            file = io.BytesIO()
            save(file, **(more | arrays))
            yield save.__name__, file.getvalue()


def zip_of(members, method=zipfile.ZIP_STORED):
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", method, compresslevel=1) as zipped:
        for name, content in members.items():
            zipped.writestr(name, content)
    return file.getvalue()


def bombs(data, full):
    """Yield small files that would be large in memory; not `full`: those that are soon made."""
    kind, number, table, arrays = unsealed(data)
    big = bytes(300_000_000)
    array = io.BytesIO()
    np.save(array, np.zeros(2))
    heading = array.getvalue()[:128].replace(b"(2,), }       ", b"(37500000,), }")
    yield "deflated zeros", zip_of({"meta.npy": b"", "q.npy": heading + big}, zipfile.ZIP_DEFLATED)
    yield "deflated list", zip_of({"members.npy": heading + big}, zipfile.ZIP_DEFLATED)
    listed = [["meta", "<U10", [], 0, "0" * 64], ["q", "<f8", [1 << 40, 2], 0, "0" * 64]]
    for shape in ([1 << 40, 2], [0, 1 << 47], [1 << 47, 0, 1 << 47], [-1], [1 << 62] * 4, [True]):
        listed[1][2] = shape
        yield f"shape {shape}", listing({"kind": kind, "format": number, "members": listed})
    listed[1] = ["q", "<U999999999", [0], 0, "0" * 64]
    yield "long texts", listing({"kind": kind, "format": number, "members": listed})
    yield "deep list", listing("[" * 300_000)
    yield "many lists", listing("[" + "[]," * 300_000 + "[]]")
    yield "many digits", listing("[" + "9" * 900_000 + "]")
    long = {
        "deep table": "[" * 2_000_000,
        "deep tables": '{"a":' * 500_000,
        "lists": "[" + "[]," * 4_000_000 + "[]]",
        "tables": "[" + "{}," * 4_000_000 + "{}]",
        "numbers": "[" + "1," * 5_000_000 + "1]",
        "digits": "[" + "9" * 5_000_000 + "]",
        "text": json.dumps("x" * 10_000_000),
    }
    lies = {
        "step": json.dumps(table | {"step": 1e6}),
        "rows": json.dumps(table | {"rows": 10**12, "planned_rows": 10**12}),
    }
    if "shapes" in table:
        yield from packed_bombs(kind, number, table, arrays, full)
    for name, text in (lies | (long if full else {})).items():
        yield name, sealed_again(kind, number, text, arrays)


def packed_bombs(kind, number, table, arrays, full):
    """Yield run files of zeros, and such as say that they are, or hold more than they say."""
    deflate = zlib.compressobj(9, zlib.DEFLATED, -15)
    zeros = b"".join(deflate.compress(bytes(1 << 20)) for _ in range(1000)) + deflate.flush()
    small = {name: np.frombuffer(b"\x02" + zeros, np.uint8) for name in arrays}
    for rows in (10, 10**6, 10**7, (1 << 20) * 125, 10**12):
        shapes = {name: [rows, *shape[1:]] for name, shape in table["shapes"].items()}
        told = table | {"rows": rows, "planned_rows": rows, "shapes": shapes}
        for what, some in ({"zeros": small, "rows": arrays} if full else {"zeros": small}).items():
            yield f"{what} of {rows} rows", sealed_again(kind, number, json.dumps(told), some)


def listing(table):
    """Return a file that begins as a sealed one does, with any list at all."""
    text = (table if isinstance(table, str) else json.dumps(table)).encode()
    array = io.BytesIO()
    np.save(array, np.array(text))
    return zip_of({"members.npy": array.getvalue(), "meta.npy": array.getvalue()})
