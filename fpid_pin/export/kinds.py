"""What a kernel's arguments are: numbers, records, arrays of constant size.

A kernel names no types. Printed for given arguments it has them all, as numba has when it compiles.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray

#: An extent: a number, the name of a constant, or None where a slice leaves it open.
Extent = int | str | None


@dataclass(frozen=True)
class Number:
    """A real number, an integer, or a truth value: ``"real"``, ``"int"``, ``"bool"``."""

    name: str

    def __str__(self) -> str:
        return self.name


REAL, INT, BOOL = Number("real"), Number("int"), Number("bool")


@dataclass(frozen=True)
class Record:
    """A record: its name, and its fields in order."""

    name: str
    fields: tuple[tuple[str, Number], ...]

    @classmethod
    def of(cls, name: str, dtype: Any) -> Record:
        """Return the record that a structured dtype (`kernels.layout`) describes."""
        kinds = {"f": REAL, "i": INT, "b": BOOL}
        return cls(name, tuple((field, kinds[dtype[field].kind]) for field in dtype.names))

    def __str__(self) -> str:
        return self.name

    def place(self, field: str) -> int | None:
        """Return which of the fields has this name; None: none has."""
        return next((k for k, (name, _) in enumerate(self.fields) if name == field), None)


@dataclass(frozen=True)
class Array:
    """An array of numbers or records, C-contiguous."""

    element: Number | Record
    shape: tuple[Extent, ...]

    def __str__(self) -> str:
        return f"array of {self.element}, {self.shape}"


Kind = Number | Record | Array


def joined(one: Number, other: Number) -> Number:
    """Return the kind that holds numbers of both kinds."""
    if one == other:
        return one
    return REAL if REAL in (one, other) else INT


def words(values: Any) -> FloatArray:
    """Return an array of numbers or records as JavaScript's memory has it: a number a field."""
    values = np.asarray(values)
    if values.dtype.names is None:
        return np.asarray(values, dtype=np.float64).ravel()
    columns = [values[name].astype(np.float64).ravel() for name in values.dtype.names]
    return np.stack(columns, axis=1).ravel()
