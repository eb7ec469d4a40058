"""Kernels in JavaScript: one Float64Array `M` is the memory, as in C.

A record or an array is the place where it begins, a field the number that lies so many places
further: nothing is allocated in a tick, and what an engine's compiler sees is the same few kinds of
operation everywhere. `kinds.words` gives what belongs into the memory.
"""

from collections.abc import Mapping, Sequence
from typing import ClassVar

from fpid_pin.export.c99 import C99
from fpid_pin.export.kinds import REAL, Array, Kind, Number, Rank, Record, Value, offset

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

_OWN = ("min", "max", "mod", "floordiv", "int", "copysign", "ipow")
_RESERVED = """
    arguments await break case catch class const continue debugger default delete do else
    enum eval export extends false finally for function if implements import in instanceof
    interface let new null package private protected public return static super switch this
    throw true try typeof undefined var void while with yield M Math Number NaN Infinity Object
"""


class JavaScript(C99):
    """ECMAScript 2015."""

    functions: ClassVar[Mapping[str, str]] = {
        "fabs": "Math.abs", "isfinite": "Number.isFinite", "isnan": "Number.isNaN",
        **{name: name for name in _OWN},
    }  # fmt: skip
    reserved: ClassVar = frozenset(_RESERVED.split()).union(_OWN)
    taken: ClassVar = frozenset()

    def real(self, value: float) -> Value:
        """Return a real constant, to the last bit."""
        text = repr(value).replace("inf", "Infinity").replace("nan", "NaN")
        return Value(text, REAL, Rank.UNARY if text.startswith("-") else Rank.ATOM, value)

    def to_real(self, value: Value) -> Value:
        """Return an integer as a real number, which it is."""
        return value._replace(kind=REAL)

    def field(self, record: Value, place: int, name: str, kind: Number) -> Value:
        """Return a field of a record: the number so many places further."""
        return Value(f"M[{record.within(Rank.SUM)} + {place} /* {name} */]", kind)

    def at(self, array: Value, kind: Array, index: Sequence[Value], found: Kind) -> Value:
        """Return what begins at an element of an array: the number there, or its place."""
        stride = len(kind.element.fields) if isinstance(kind.element, Record) else 1
        before = offset(kind, index, stride)
        place = array._replace(kind=found)
        if before.text != "0":
            place = Value(f"{array.within(Rank.SUM)} + {before.within(Rank.SUM)}", found, Rank.SUM)
        return Value(f"M[{place.text}]", found) if isinstance(found, Number) else place

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """Call a function, of `Math` as a rule."""
        given = ", ".join(argument.text for argument in arguments)
        return Value(f"{self.functions.get(name, f'Math.{name}')}({given})", kind)

    def declare(self, name: str, kind: Kind) -> str:
        """Return a declaration up to the name."""
        return f"let {name}"

    def head(
        self, name: str, parameters: Mapping[str, Kind], returns: Kind | None, unused: Sequence[str]
    ) -> list[str]:
        """Return the line that opens a function."""
        return [f"function {name}({', '.join(parameters)}) {{"]
