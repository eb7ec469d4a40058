"""Kernels in C99: records are structs, arrays are pointers to their first element.

`real_t` is double or float. Every constant is cast to it, so that no operation is made in a
precision that was not asked for, and integers become real where they meet reals, visibly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Kind, Number, Record
from fpid_pin.export.language import (
    ATOM,
    COMPARISON,
    SUM,
    Language,
    Parameter,
    Value,
    offset,
)  # fmt: skip

#: Functions that the printed kernels call by these names. min and max are Python's, which let NaN
#: through where it comes first and drop it where it comes second: fmin and fmax would always drop
#: it, and a joint that has lost its numbers would look sound.
HELPERS = """\
#ifdef FPID_SINGLE
#define real_sqrt sqrtf
#define real_sin sinf
#define real_cos cosf
#define real_floor floorf
#define real_abs fabsf
#else
#define real_sqrt sqrt
#define real_sin sin
#define real_cos cos
#define real_floor floor
#define real_abs fabs
#endif
static inline real_t real_min(real_t a, real_t b) { return (b < a) ? b : a; }
static inline real_t real_max(real_t a, real_t b) { return (b > a) ? b : a; }
static inline int int_min(int a, int b) { return (b < a) ? b : a; }
static inline int int_max(int a, int b) { return (b > a) ? b : a; }
static inline int int_mod(int a, int b) { return ((a % b) + b) % b; }
/* What no int can hold becomes 0: to convert it is undefined in C. */
static inline int real_int(real_t x) {
    return ((x > (real_t)-2e9) && (x < (real_t)2e9)) ? (int)x : 0;
}
"""

_RESERVED = """
    auto break case char const continue default do double else enum extern float for goto if
    inline int long register restrict return short signed sizeof static struct switch
    typedef union unsigned void volatile while main real_t
"""


class C99(Language):
    """C99, or C++.

    Parameters
    ----------
    prefix
        Of the names of structs.
    """

    equal: Mapping[str, str] = {"==": "==", "!=": "!="}
    reserved = frozenset(_RESERVED.split())

    def __init__(self, prefix: str = "fpid_") -> None:
        self.prefix = prefix

    def truth(self, value: bool) -> str:
        """See `Language`."""
        return "1" if value else "0"

    def real(self, value: float) -> Value:
        """See `Language`."""
        if math.isfinite(value):
            return Value(f"(real_t){value!r}", REAL)
        name = "NAN" if math.isnan(value) else "INFINITY"
        return Value(f"(real_t){name}" if not value < 0.0 else f"(-(real_t){name})", REAL)

    def coerce(self, value: Value, kind: Number) -> Value:
        """See `Language`."""
        if value.kind == kind:
            return value
        if kind == BOOL:
            zero = self.real(0.0).text if value.kind == REAL else "0"
            return Value(f"{value.within(SUM)} != {zero}", BOOL, COMPARISON)
        if kind == INT:
            # A truth value is an int of 0 or 1.
            return Value(value.text, INT, value.rank)
        return Value(f"(real_t){value.within(ATOM)}", REAL)

    def type_of(self, kind: Kind) -> str:
        """Return the name of a type, a pointer's without its star."""
        if isinstance(kind, Array):
            return self.type_of(kind.element)
        if isinstance(kind, Record):
            return self.prefix + kind.name
        return "real_t" if kind == REAL else "int"

    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """See `Language`."""
        dot = f"{record.text[1:]}.{name}" if record.text.startswith("&") else ""
        return Value(dot or f"{record.text}->{name}", kind, ATOM, record.roots)

    def element(self, array: Value, index: Sequence[Value]) -> Value:
        """See `Language`."""
        kind = array.kind
        assert isinstance(kind, Array)
        text = f"{_base(array)}[{offset(kind, index).text}]"
        if len(index) < len(kind.shape):
            row = Array(kind.element, kind.shape[len(index) :])
            return Value(f"&{text}", row, ATOM, array.roots)
        if isinstance(kind.element, Record):
            return Value(f"&{text}", kind.element, ATOM, array.roots)
        return Value(text, kind.element, ATOM, array.roots)

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """See `Language`."""
        given = ", ".join(argument.text for argument in arguments)
        if name == "isfinite":
            return Value(f"isfinite({given}) != 0", BOOL, COMPARISON)
        if name == "int":
            return Value(f"real_int({given})", INT)
        return Value(f"{'int' if kind == INT else 'real'}_{name}({given})", kind)

    def declare(self, name: str, kind: Kind, fixed: bool) -> str:
        """See `Language`."""
        if isinstance(kind, Number):
            return f"{self.type_of(kind)} {name}"
        return f"{'const ' * fixed}{self.type_of(kind)} *{name}"

    def loop(self, name: str, start: str, stop: str) -> str:
        """See `Language`."""
        return f"for (int {name} = {start}; {name} < {stop}; ++{name}) {{"

    def head(self, name: str, parameters: Sequence[Parameter], returns: Kind | None) -> list[str]:
        """See `Language`."""
        given = [self.declare(p.name, p.kind, not p.written) for p in parameters]
        result = "void" if returns is None else self.type_of(returns)
        lines = [f"static {result} {name}({', '.join(given) or 'void'})", "{"]
        return lines + [f"    (void){p.name};" for p in parameters if not p.used]

    def structs(self, records: Iterable[Record]) -> str:
        """Return the types of records."""
        parts = []
        for record in records:
            lines = [f"    {self.type_of(kind)} {name};" for name, kind in record.fields]
            parts.append("\n".join(["typedef struct {", *lines, f"}} {self.prefix}{record.name};"]))
        return "\n\n".join(parts) + "\n"


def _base(array: Value) -> str:
    return f"({array.text})" if array.text.startswith("&") else array.text
