"""Kernels in JavaScript: one Float64Array `M` is the memory, as in C.

A record or an array is the place where it begins, a field the number that lies so many places
further: nothing is allocated in a tick, and what an engine's compiler sees is the same few kinds of
operation everywhere. `kinds.words` gives what belongs into the memory.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Kind, Number, Record
from fpid_pin.export.language import (
    ATOM,
    CHOICE,
    COMPARISON,
    SUM,
    UNARY,
    Language,
    Parameter,
    Value,
    offset,
    stride_of,
)  # fmt: skip

#: Functions that the printed kernels call. min and max are Python's: Math.min and Math.max would
#: make NaN of either argument's.
HELPERS = """\
const min = (a, b) => (b < a ? b : a);
const max = (a, b) => (b > a ? b : a);
const mod = (a, b) => ((a % b) + b) % b;
const whole = (x) => (Math.abs(x) < 2e9 ? Math.trunc(x) : 0);
"""

_MATH = {"abs": "Math.abs", "isfinite": "Number.isFinite"}
_RESERVED = """
    arguments await break case catch class const continue debugger default delete do else
    enum eval export extends false finally for function if implements import in instanceof
    interface let new null package private protected public return static super switch this
    throw true try typeof undefined var void while with yield M min max mod whole Math
    Number NaN Infinity
"""


class JavaScript(Language):
    """ECMAScript 2015."""

    equal: Mapping[str, str] = {"==": "===", "!=": "!=="}
    reserved = frozenset(_RESERVED.split())

    def truth(self, value: bool) -> str:
        """See `Language`."""
        return "true" if value else "false"

    def real(self, value: float) -> Value:
        """See `Language`."""
        if math.isnan(value):
            return Value("NaN", REAL)
        text = repr(value).replace("inf", "Infinity")
        return Value(text, REAL, UNARY if text.startswith("-") else ATOM)

    def coerce(self, value: Value, kind: Number) -> Value:
        """See `Language`."""
        if value.kind == kind:
            return value
        if kind == BOOL:
            return Value(f"{value.within(SUM)} !== 0", BOOL, COMPARISON)
        if value.kind == BOOL:
            return Value(f"{value.within(CHOICE + 1)} ? 1 : 0", kind, CHOICE)
        return Value(value.text, kind, value.rank)

    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """See `Language`."""
        return _read(f"{record.within(SUM)} + {place} /* {name} */", kind, record)

    def element(self, array: Value, index: Sequence[Value]) -> Value:
        """See `Language`."""
        kind = array.kind
        assert isinstance(kind, Array)
        at = offset(kind, index, stride_of(kind.element))
        text = array.text if at.text == "0" else f"{array.within(SUM)} + {at.within(SUM)}"
        rank = array.rank if at.text == "0" else SUM
        if len(index) < len(kind.shape):
            return Value(text, Array(kind.element, kind.shape[len(index) :]), rank, array.roots)
        if isinstance(kind.element, Record):
            return Value(text, kind.element, rank, array.roots)
        return _read(text, kind.element, array)

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """See `Language`."""
        given = ", ".join(argument.text for argument in arguments)
        if name == "int":
            return Value(f"whole({given})", INT)
        if name in ("min", "max", "mod"):
            return Value(f"{name}({given})", kind)
        return Value(f"{_MATH.get(name, f'Math.{name}')}({given})", kind)

    def declare(self, name: str, kind: Kind, fixed: bool) -> str:
        """See `Language`."""
        return f"let {name}"

    def loop(self, name: str, start: str, stop: str) -> str:
        """See `Language`."""
        return f"for (let {name} = {start}; {name} < {stop}; {name}++) {{"

    def head(self, name: str, parameters: Sequence[Parameter], returns: Kind | None) -> list[str]:
        """See `Language`."""
        return [f"function {name}({', '.join(p.name for p in parameters)}) {{"]


def _read(place: str, kind: Number, memory: Value) -> Value:
    return Value(f"M[{place}]", kind, ATOM, memory.roots)
