"""Expressions of C and JavaScript, which write operators and their precedence alike."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from fpid_pin.export.kinds import INT, Array, Kind, Number, Record

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


def field_kind(record: Value, name: str) -> tuple[int, Number]:
    """Return which of a record's fields has a name, and its kind."""
    assert isinstance(record.kind, Record)
    place = [field for field, _ in record.kind.fields].index(name)
    return place, record.kind.fields[place][1]
