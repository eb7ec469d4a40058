"""Kernels in JavaScript: one Float64Array `M` is the memory, as in C.

A record or an array is the place where it begins, a field the number that lies so many places
further: nothing is allocated in a tick, and what an engine's compiler sees is the same few kinds of
operation everywhere. `kinds.words` gives what belongs into the memory.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from fpid_pin.export.kinds import BOOL, REAL, Array, Kind, Number
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
const floordiv = (a, b) => Math.floor(a / b);
const int = (x) => (Math.abs(x) < 2e9 ? Math.trunc(x) : 0);
const copysign = (a, b) => (b < 0 || Object.is(b, -0) ? -Math.abs(a) : Math.abs(a));
const ipow = (x, k) => {
  let y = 1;
  for (let i = Math.abs(k); i > 0; i >>= 1) {
    if (i & 1) y *= x;
    x *= x;
  }
  return k < 0 ? 1 / y : y;
};
"""

_OWN = frozenset({"min", "max", "mod", "floordiv", "int", "copysign", "ipow"})
_MATH = {"fabs": "Math.abs", "isfinite": "Number.isFinite", "isnan": "Number.isNaN"}
_RESERVED = """
    arguments await break case catch class const continue debugger default delete do else
    enum eval export extends false finally for function if implements import in instanceof
    interface let new null package private protected public return static super switch this
    throw true try typeof undefined var void while with yield M Math Number NaN Infinity Object
"""


class JavaScript(Language):
    """ECMAScript 2015."""

    equal: Mapping[str, str] = {"==": "===", "!=": "!=="}
    reserved = frozenset(_RESERVED.split()) | _OWN

    def truth(self, value: bool) -> str:
        """See `Language`."""
        return "true" if value else "false"

    def real(self, value: float) -> Value:
        """See `Language`."""
        text = repr(value).replace("inf", "Infinity").replace("nan", "NaN")
        return Value(text, REAL, UNARY if text.startswith("-") else ATOM, known=value)

    def convert(self, value: Value, kind: Number) -> Value:
        """See `Language`."""
        if kind == BOOL:
            return Value(f"{value.within(SUM)} !== 0", BOOL, COMPARISON)
        if value.kind == BOOL:
            return Value(f"{value.within(CHOICE + 1)} ? 1 : 0", kind, CHOICE)
        return Value(value.text, kind, value.rank)

    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """See `Language`."""
        at = record.text
        # A place that is known to the last digit needs no sum.
        at = str(int(at) + place) if at.isdigit() else f"{record.within(SUM)} + {place}"
        return Value(f"M[{at} /* {name} */]", kind, ATOM, record.roots)

    def at(self, array: Value, index: Sequence[Value], kind: Kind) -> Value:
        """See `Language`."""
        assert isinstance(array.kind, Array)
        at = offset(array.kind, index, stride_of(array.kind.element))
        if at.text.isdigit() and array.text.isdigit():
            place = Value(str(int(array.text) + int(at.text)), kind, ATOM, array.roots)
        elif at.text == "0":
            place = Value(array.text, kind, array.rank, array.roots)
        else:
            text = f"{array.within(SUM)} + {at.within(SUM)}"
            place = Value(text, kind, SUM, array.roots)
        if isinstance(kind, Number):
            return Value(f"M[{place.text}]", kind, ATOM, array.roots)
        return place

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """See `Language`."""
        given = ", ".join(argument.text for argument in arguments)
        called = name if name in _OWN else _MATH.get(name, f"Math.{name}")
        return Value(f"{called}({given})", kind)

    def declare(self, name: str, kind: Kind, fixed: bool) -> str:
        """See `Language`."""
        return f"let {name}"

    def loop(self, name: str, start: str, stop: str) -> str:
        """See `Language`."""
        return f"for (let {name} = {start}; {name} < {stop}; {name}++) {{"

    def head(self, name: str, parameters: Sequence[Parameter], returns: Kind | None) -> list[str]:
        """See `Language`."""
        return [f"function {name}({', '.join(p.name for p in parameters)}) {{"]
