"""Ways of damaging a file."""

import struct


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
