"""What a kernel's arguments are: numbers, records, arrays of constant size, bundles of arrays.

A kernel names no types. Printed for given arguments it has them all, as numba has when it compiles.
An expression of the other language is a `Value` of such a kind.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray

#: An extent; None where a slice leaves it open.
Extent = int | None
#: Integers of a controller that kernels write to.
MOVING = frozenset({"ticks", "acting", "correcting"})


@dataclass(frozen=True)
class Named:
    """What messages call by its name."""

    name: str

    def __str__(self) -> str:
        return self.name


class Number(Named):
    """A real number, or an integer; truth is an integer."""


REAL, INT = Number("real"), Number("int")


@dataclass(frozen=True)
class Record(Named):
    """A record: its name, its fields in order, and values of those that never change.

    What depends on a constant is decided when a kernel is printed: a law without an observer has
    no line of one.
    """

    fields: tuple[tuple[str, Number], ...]
    constants: tuple[tuple[str, int], ...] = ()
    #: Whether it is never written to.
    fixed: bool = False

    @property
    def kept(self) -> list[tuple[str, Number]]:
        """Fields that are no constants."""
        constants = dict(self.constants)
        return [(name, kind) for name, kind in self.fields if name not in constants]


@dataclass(frozen=True)
class Array:
    """An array of numbers or records, C-contiguous."""

    element: Number | Record
    shape: tuple[Extent, ...]
    #: Of a part of columns: how many elements a row is after the one before; None: a row's own.
    pitch: Extent = None
    #: Whether it is never written to.
    fixed: bool = False

    def __str__(self) -> str:
        return f"array of {self.element}, {self.shape}"


@dataclass(frozen=True)
class Bundle(Named):
    """Arrays by name, in one argument: name, kind, and text, given the argument's name as {}."""

    members: tuple[tuple[str, Array, str], ...]


Kind = Number | Record | Array | Bundle


def real(*shape: int) -> Array:
    """Return the kind of an array of numbers."""
    return Array(REAL, shape)


def array_kind(
    name: str, values: Any, constants: Collection[str] | None = None, *, fixed: bool = False
) -> Array:
    """Return what the printer is told of an array, or of records called `name`.

    `constants` are integer fields that never change, None: all but `MOVING`; those that are the
    same everywhere are known to the printer. `fixed`: nothing of it is ever written to.
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

    `texts` says how each is written, see `Bundle`; `constants` and `fixed` are `array_kind`'s, by
    array.
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


#: How tightly an expression holds together; a looser one goes into parentheses.
Rank = IntEnum("Rank", "CHOICE OR AND COMPARISON SUM PRODUCT UNARY ATOM")


class Value(NamedTuple):
    """An expression in the other language: its text, kind, and how tightly it holds together."""

    text: str
    kind: Kind
    rank: int = Rank.ATOM
    #: Its value where it is a constant.
    known: bool | float | None = None

    def within(self, rank: int) -> str:
        """Return the text, in parentheses where something of `rank` would tear it apart."""
        return self.text if self.rank >= rank else f"({self.text})"


def offset(array: Array, index: Sequence[Value], stride: int = 1) -> Value:
    """Return how many elements of `stride` lie before the one, or the row, of an index."""
    terms: list[str] = []
    sure, rank = 0, int(Rank.ATOM)
    for k, value in enumerate(index):
        size = stride * math.prod(extent or 1 for extent in array.shape[k + 1 :])
        if k == 0 and array.pitch is not None:
            size = array.pitch * stride
        if value.known is not None:
            sure += int(value.known) * size
        else:
            terms.append(value.text if size == 1 else f"{value.within(Rank.UNARY)} * {size}")
            rank = min(value.rank if size == 1 else Rank.PRODUCT, rank)
    if sure or not terms:
        terms.append(str(sure))
    return Value(" + ".join(terms), INT, Rank.SUM if len(terms) > 1 else rank)
