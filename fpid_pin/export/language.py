"""What the languages that kernels are printed in differ in.

Operators, their precedence, blocks, loops and conditional expressions are written alike in C and
JavaScript. What is not is here: numbers, memory, declarations, functions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from fpid_pin.export.kinds import INT, REAL, Array, Kind, Number, Record

#: How tightly an expression holds together; a looser one goes into parentheses.
CHOICE, OR, AND, COMPARISON, SUM, PRODUCT, UNARY, ATOM = range(8)


class Value(NamedTuple):
    """An expression in the other language.

    Attributes
    ----------
    text
        As it is written.
    kind
        What it is.
    rank
        How tightly it holds together.
    known
        Its value where it is a constant; None: it is none.
    """

    text: str
    kind: Kind
    rank: int = ATOM
    known: bool | float | None = None

    def within(self, rank: int) -> str:
        """Return the text, in parentheses where something of `rank` would tear it apart."""
        return self.text if self.rank >= rank else f"({self.text})"


def offset(array: Array, index: Sequence[Value], stride: int = 1) -> Value:
    """Return how many elements of `stride` lie before the one, or the row, of an index."""
    terms: list[str] = []
    sure, rank = 0, ATOM
    for k, value in enumerate(index):
        size = stride
        for extent in array.shape[k + 1 :]:
            size *= extent or 1
        if k == 0 and array.pitch is not None:
            size = array.pitch * stride
        if value.known is not None:
            sure += int(value.known) * size
        else:
            terms.append(value.text if size == 1 else f"{value.within(UNARY)} * {size}")
            rank = min(value.rank if size == 1 else PRODUCT, rank)
    if sure or not terms:
        terms.append(str(sure))
    return Value(" + ".join(terms), INT, SUM if len(terms) > 1 else rank)


class Language(ABC):
    """A language of the C family.

    Attributes
    ----------
    functions
        Names of functions that are called otherwise than in Python.
    reserved
        Names that no variable may have.
    taken
        Names that no function may have, either.
    """

    functions: Mapping[str, str]
    reserved: frozenset[str]
    taken: frozenset[str] = frozenset()

    def number(self, value: bool | float) -> Value:
        """Return a constant."""
        if isinstance(value, float):
            return self.real(value)
        return Value(str(int(value)), INT, ATOM if value >= 0 else UNARY, value)

    def coerce(self, value: Value, kind: Number) -> Value:
        """Return a number as one of another kind: an integer as a real one."""
        if kind == REAL and value.kind == INT:
            return self.to_real(value) if value.known is None else self.real(float(value.known))
        return value

    def name(self, name: str) -> str:
        """Return how a variable or a field is called, where the language has taken its name."""
        return f"{name}_v" if name in self.reserved else name

    def element(self, array: Value, index: Sequence[Value], part: Array | None = None) -> Value:
        """Return an element of an array, or a row of it, or a `part` that begins there."""
        kind = array.kind
        assert isinstance(kind, Array)
        rest = kind.shape[len(index) :]
        row = Array(kind.element, rest, fixed=kind.fixed) if rest else kind.element
        return self.at(array, index, part or row)

    @abstractmethod
    def real(self, value: float) -> Value:
        """Return a real constant, to the last bit."""

    @abstractmethod
    def to_real(self, value: Value) -> Value:
        """Return an integer as a real number."""

    @abstractmethod
    def field(self, record: Value, name: str) -> Value:
        """Return a field of a record."""

    @abstractmethod
    def at(self, array: Value, index: Sequence[Value], kind: Kind) -> Value:
        """Return what begins at an element of an array: the number there, or its address."""

    @abstractmethod
    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """Call `min`, `max`, `abs`, `int`, `mod`, `floordiv`, `ipow` or a function of `math`."""

    @abstractmethod
    def declare(self, name: str, kind: Kind) -> str:
        """Return a declaration up to the name."""

    @abstractmethod
    def hoist(self, name: str, kind: Kind) -> str:
        """Return a declaration at the top of a function."""

    @abstractmethod
    def head(
        self, name: str, parameters: Sequence[tuple[str, Kind]], returns: Kind | None
    ) -> list[str]:
        """Return the lines that open a function."""

    def unused(self, name: str) -> list[str]:
        """Return what a function says of a number that it is given and does not look at."""
        return []


def field_kind(record: Value, name: str) -> tuple[int, Number]:
    """Return which of a record's fields has a name, and its kind."""
    assert isinstance(record.kind, Record)
    place = [field for field, _ in record.kind.fields].index(name)
    return place, record.kind.fields[place][1]
