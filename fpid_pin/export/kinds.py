"""What a kernel's arguments are: numbers, records, arrays of constant size, bundles of arrays.

A kernel names no types. Printed for given arguments it has them all, as numba has when it compiles.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from fpid_pin.checks import FloatArray

#: An extent; None where a slice leaves it open.
Extent = int | None
#: Integers of a controller that kernels write to.
MOVING = frozenset({"ticks", "acting", "pushing"})


@dataclass(frozen=True)
class Number:
    """A real number, or an integer; truth is an integer."""

    name: str

    def __str__(self) -> str:
        return self.name


REAL, INT = Number("real"), Number("int")


@dataclass(frozen=True)
class Record:
    """A record: its name, its fields in order, and values of those that never change.

    What depends on a constant is decided when a kernel is printed: a law without an observer has
    no line of one.
    """

    name: str
    fields: tuple[tuple[str, Number], ...]
    constants: tuple[tuple[str, int], ...] = ()
    #: Whether it is never written to.
    fixed: bool = False

    def __str__(self) -> str:
        return self.name

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
    fixed
        Whether it is never written to.
    """

    element: Number | Record
    shape: tuple[Extent, ...]
    pitch: Extent = None
    fixed: bool = False

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


def real(*shape: int) -> Array:
    """Return the kind of an array of numbers."""
    return Array(REAL, shape)


def array_kind(
    name: str, values: Any, constants: Collection[str] | None = None, *, fixed: bool = False
) -> Array:
    """Return what the printer is told of an array.

    Parameters
    ----------
    name
        Of its records, if they are any.
    values
        At t = 0.
    constants
        Integer fields that never change; those that are the same everywhere are known to the
        printer. None: all but `MOVING`.
    fixed
        Whether nothing of it is ever written to.
    """

    def kind_of(dtype: Any) -> Number:
        return REAL if dtype.kind == "f" else INT

    dtype = values.dtype
    if dtype.names is None:
        return Array(kind_of(dtype), values.shape, fixed=fixed)
    known = []
    for field in dtype.names:
        steady = field not in MOVING if constants is None else field in constants
        found = np.unique(values[field])
        if dtype[field].kind == "i" and steady and len(found) == 1:
            known.append((field, int(found[0])))
    fields = tuple((field, kind_of(dtype[field])) for field in dtype.names)
    return Array(Record(name, fields, tuple(known), fixed), values.shape, fixed=fixed)


#: What a record is called whose array is not.
_RECORDS = {
    "ops": "operator", "poles": "pole", "modes": "mode", "bodies": "body", "links": "link",
    "frames": "frame", "joints": "joint",
}  # fmt: skip


def bundle(
    name: str, arrays: Mapping[str, Any], texts: Mapping[str, str], *,
    constants: Mapping[str, Collection[str]] | None = None, fixed: Collection[str] = (),
) -> Bundle:  # fmt: skip
    """Return what the printer is told of arrays by name, as of a NamedTuple of `kernels.records`.

    Parameters
    ----------
    name
        Of the argument's type.
    arrays
        At t = 0.
    texts
        How each array is written, see `Bundle`.
    constants
        Integer fields that never change, by array; None: all but `MOVING`.
    fixed
        Arrays that are never written to.
    """
    members = []
    for field, values in arrays.items():
        own = None if constants is None else constants.get(field, ())
        kind = array_kind(_RECORDS.get(field, field), values, own, fixed=field in fixed)
        members.append((field, kind, texts[field]))
    return Bundle(name, tuple(members))


def words(values: Any) -> FloatArray:
    """Return an array of numbers or records as JavaScript's memory has it: a number a field."""
    values = np.asarray(values)
    if values.dtype.names is None:
        return np.asarray(values, dtype=np.float64).ravel()
    columns = [values[name].astype(np.float64).ravel() for name in values.dtype.names]
    return np.stack(columns, axis=1).ravel()
