"""What a kernel's arguments are: numbers, records, arrays of constant size, bundles of arrays.

A kernel names no types. Printed for given arguments it has them all, as numba has when it compiles.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray

#: An extent; None where a slice leaves it open.
Extent = int | None


@dataclass(frozen=True)
class Number:
    """A real number, an integer, or a truth value: ``"real"``, ``"int"``, ``"bool"``."""

    name: str

    def __str__(self) -> str:
        return self.name


REAL, INT, BOOL = Number("real"), Number("int"), Number("bool")
_NUMBERS = {"f": REAL, "i": INT, "b": BOOL}


@dataclass(frozen=True)
class Record:
    """A record: its name, its fields in order, and values of those that never change.

    What depends on a constant is decided when a kernel is printed: a law without an observer has
    no line of one.
    """

    name: str
    fields: tuple[tuple[str, Number], ...]
    constants: tuple[tuple[str, int], ...] = ()

    @classmethod
    def of(cls, name: str, dtype: Any, constants: Iterable[tuple[str, int]] = ()) -> Record:
        """Return the record that a structured dtype (`kernels.layout`) describes."""
        fields = tuple((field, _NUMBERS[dtype[field].kind]) for field in dtype.names)
        return cls(name, fields, tuple(constants))

    def __str__(self) -> str:
        return self.name

    def place(self, field: str) -> int | None:
        """Return which of the fields has this name; None: none has."""
        return next((k for k, (name, _) in enumerate(self.fields) if name == field), None)

    @property
    def kept(self) -> list[tuple[str, Number]]:
        """Fields that are no constants."""
        constants = dict(self.constants)
        return [(name, kind) for name, kind in self.fields if name not in constants]


@dataclass(frozen=True)
class Array:
    """An array of numbers or records, C-contiguous.

    Attributes
    ----------
    pitch
        Of a part of columns: how many elements a row is after the one before; None: as many as a
        row has.
    """

    element: Number | Record
    shape: tuple[Extent, ...]
    pitch: Extent = None

    def __str__(self) -> str:
        return f"array of {self.element}, {self.shape}"


@dataclass(frozen=True)
class Bundle:
    """Arrays by name, in one argument.

    Attributes
    ----------
    members
        Name, kind, and how the array is written in the other language, given the argument's name
        as ``{}``.
    """

    name: str
    members: tuple[tuple[str, Array, str], ...]

    def __str__(self) -> str:
        return self.name


Kind = Number | Record | Array | Bundle


def array_kind(name: str, values: Any, constants: Iterable[str] | None = None) -> Array:
    """Return what the printer is told of an array.

    Parameters
    ----------
    name
        Of its records, if they are any.
    values
        At t = 0.
    constants
        Integer fields that never change; those that are the same everywhere are known to the
        printer. None: all integer fields.
    """
    if values.dtype.names is None:
        return Array(_NUMBERS[values.dtype.kind], values.shape)
    whole = [field for field in values.dtype.names if values.dtype[field].kind == "i"]
    wanted = [field for field in whole if constants is None or field in constants]
    found = [(field, np.unique(values[field])) for field in wanted]
    known = [(field, int(value[0])) for field, value in found if value.size == 1]
    return Array(Record.of(name, values.dtype, known), values.shape)


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
