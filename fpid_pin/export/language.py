"""What the languages that kernels are printed in differ in.

Operators, their precedence, blocks, loops and conditional expressions are written alike in Python,
C and JavaScript. What is not is here: numbers, memory, declarations, functions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Extent, Kind, Number, Record

#: How tightly an expression holds together; a looser one goes into parentheses.
CHOICE, OR, AND, COMPARISON, SUM, PRODUCT, UNARY, ATOM = range(8)


@dataclass(frozen=True)
class Value:
    """An expression in the other language.

    Attributes
    ----------
    text
        As it is written.
    kind
        What it is.
    rank
        How tightly it holds together.
    roots
        Names of the variables through which it reaches into memory.
    """

    text: str
    kind: Kind
    rank: int = ATOM
    roots: frozenset[str] = field(default=frozenset())

    def within(self, rank: int) -> str:
        """Return the text, in parentheses where something of `rank` would tear it apart."""
        return self.text if self.rank >= rank else f"({self.text})"


@dataclass(frozen=True)
class Parameter:
    """An argument of a printed function, and whether what it points to is written."""

    name: str
    kind: Kind
    written: bool
    used: bool


def product(extents: Sequence[Extent]) -> Value:
    """Return how many elements there are in `extents` together."""
    numbers = [extent for extent in extents if isinstance(extent, int)]
    names = [str(extent) for extent in extents if not isinstance(extent, int)]
    count = 1
    for number in numbers:
        count *= number
    factors = names if count == 1 and names else [*names, str(count)]
    return Value(" * ".join(factors), INT, ATOM if len(factors) == 1 else PRODUCT)


def offset(array: Array, index: Sequence[Value], stride: int = 1) -> Value:
    """Return how many elements of `stride` lie before the one, or the row, of an index."""
    terms: list[str] = []
    sure = 0
    for k, value in enumerate(index):
        size = product((*array.shape[k + 1 :], stride))
        if value.text.isdigit() and size.text.isdigit():
            sure += int(value.text) * int(size.text)
        elif size.text == "1":
            terms.append(value.within(SUM))
        elif value.text != "0":
            terms.append(size.text if value.text == "1" else f"{value.within(UNARY)} * {size.text}")
    if sure or not terms:
        terms.append(str(sure))
    rank = SUM if len(terms) > 1 else PRODUCT if " * " in terms[0] else ATOM
    return Value(" + ".join(terms), INT, min(rank, *(v.rank for v in index)))


class Language(ABC):
    """A language of the C family."""

    equal: Mapping[str, str]
    reserved: frozenset[str]

    def number(self, value: bool | float) -> Value:
        """Return a constant."""
        if isinstance(value, bool):
            return Value(self.truth(value), BOOL)
        if isinstance(value, int):
            return Value(str(value), INT, ATOM if value >= 0 else UNARY)
        return self.real(value)

    @abstractmethod
    def truth(self, value: bool) -> str:
        """Return true or false."""

    @abstractmethod
    def real(self, value: float) -> Value:
        """Return a real constant, to the last bit."""

    @abstractmethod
    def coerce(self, value: Value, kind: Number) -> Value:
        """Return a number as one of another kind."""

    @abstractmethod
    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """Return a field of a record."""

    @abstractmethod
    def element(self, array: Value, index: Sequence[Value]) -> Value:
        """Return an element of an array, or a row of it."""

    @abstractmethod
    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """Call one of `min`, `max`, `abs`, `int`, `mod` or a function of `math`."""

    @abstractmethod
    def declare(self, name: str, kind: Kind, fixed: bool) -> str:
        """Return what stands left of ``=`` where a variable begins; `fixed`: memory not written."""

    @abstractmethod
    def loop(self, name: str, start: str, stop: str) -> str:
        """Return the head of a loop over integers."""

    @abstractmethod
    def head(self, name: str, parameters: Sequence[Parameter], returns: Kind | None) -> list[str]:
        """Return the lines that open a function."""


def zero(kind: Kind) -> float | int | bool:
    """Return what a number is before it has a value."""
    return {REAL: 0.0, INT: 0, BOOL: False}[kind] if isinstance(kind, Number) else 0


def stride_of(element: Number | Record) -> int:
    """Return how many numbers an element of an array holds."""
    return len(element.fields) if isinstance(element, Record) else 1
