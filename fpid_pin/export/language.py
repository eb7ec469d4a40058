"""What the languages that kernels are printed in differ in.

Operators, their precedence, blocks, loops and conditional expressions are written alike in Python,
C and JavaScript. What is not is here: numbers, memory, declarations, functions.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Kind, Number, Record

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
    known
        Its value where it is a constant; None: it is none.
    """

    text: str
    kind: Kind
    rank: int = ATOM
    roots: frozenset[str] = field(default=frozenset())
    known: bool | float | None = None

    def within(self, rank: int) -> str:
        """Return the text, in parentheses where something of `rank` would tear it apart."""
        return self.text if self.rank >= rank else f"({self.text})"


@dataclass(frozen=True)
class Parameter:
    """An argument of a kernel: whether what it points to is written, whether it is looked at."""

    name: str
    kind: Kind
    written: bool
    used: bool

    @property
    def taken(self) -> bool:
        """Whether the printed function has it: numbers may be calls, which are made in any case."""
        return self.used or isinstance(self.kind, Number)


def offset(array: Array, index: Sequence[Value], stride: int = 1) -> Value:
    """Return how many elements of `stride` lie before the one, or the row, of an index."""
    terms: list[str] = []
    sure = 0
    for k, value in enumerate(index):
        size = stride
        for extent in array.shape[k + 1 :]:
            size *= extent or 1
        if k == 0 and array.pitch is not None:
            size = array.pitch * stride
        if isinstance(value.known, int):
            sure += value.known * size
        else:
            terms.append(value.within(SUM) if size == 1 else f"{value.within(UNARY)} * {size}")
    if sure or not terms:
        terms.append(str(sure))
    rank = SUM if len(terms) > 1 else PRODUCT if " * " in terms[0] else ATOM
    return Value(" + ".join(terms), INT, min(rank, *(v.rank for v in index)))


class Language(ABC):
    """A language of the C family.

    Attributes
    ----------
    equal
        How ``==`` and ``!=`` are written.
    reserved
        Names that no variable may have.
    taken
        Names that no function may have, either.
    """

    equal: Mapping[str, str]
    reserved: frozenset[str]
    taken: frozenset[str] = frozenset()

    def number(self, value: bool | float) -> Value:
        """Return a constant."""
        if isinstance(value, bool):
            return Value(self.truth(value), BOOL, known=value)
        if isinstance(value, int):
            return Value(str(value), INT, ATOM if value >= 0 else UNARY, known=value)
        return self.real(value)

    def coerce(self, value: Value, kind: Number) -> Value:
        """Return a number as one of another kind."""
        if value.kind == kind:
            return value
        if value.known is not None:
            return self.number({REAL: float, INT: int, BOOL: bool}[kind](value.known))
        return self.convert(value, kind)

    def element(self, array: Value, index: Sequence[Value], part: Array | None = None) -> Value:
        """Return an element of an array, or a row of it, or a `part` that begins there."""
        kind = array.kind
        assert isinstance(kind, Array)
        rest = kind.shape[len(index) :]
        return self.at(array, index, part or (Array(kind.element, rest) if rest else kind.element))

    def name(self, name: str) -> str:
        """Return how a variable or a field is called, where the language has taken its name."""
        return f"{name}_v" if name in self.reserved else name

    @abstractmethod
    def truth(self, value: bool) -> str:
        """Return true or false."""

    @abstractmethod
    def real(self, value: float) -> Value:
        """Return a real constant, to the last bit."""

    @abstractmethod
    def convert(self, value: Value, kind: Number) -> Value:
        """Return a number as one of another kind than its own."""

    @abstractmethod
    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """Return a field of a record."""

    @abstractmethod
    def at(self, array: Value, index: Sequence[Value], kind: Kind) -> Value:
        """Return what begins at an element of an array: the number there, or its address."""

    @abstractmethod
    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """Call `min`, `max`, `abs`, `int`, `mod`, `floordiv`, `ipow` or a function of `math`."""

    @abstractmethod
    def declare(self, name: str, kind: Kind, fixed: bool) -> str:
        """Return what stands left of ``=`` where a variable begins; `fixed`: memory not written."""

    @abstractmethod
    def loop(self, name: str, start: str, stop: str) -> str:
        """Return the head of a loop over integers."""

    @abstractmethod
    def head(self, name: str, parameters: Sequence[Parameter], returns: Kind | None) -> list[str]:
        """Return the lines that open a function."""


def zero(kind: Number) -> float | int | bool:
    """Return what a number is before it has a value."""
    return {REAL: 0.0, INT: 0, BOOL: False}[kind]


def stride_of(element: Number | Record) -> int:
    """Return how many numbers an element of an array holds."""
    return len(element.fields) if isinstance(element, Record) else 1
