"""Kernels in C99: records are structs, arrays are pointers to their first element.

`real_t` is double or float; <tgmath.h> finds the functions of either. Every constant is cast to it,
so that no operation is made in a precision that was not asked for, and integers become real where
they meet reals, visibly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Bundle, Kind, Number, Record
from fpid_pin.export.language import ATOM, COMPARISON, SUM, Language, Parameter, Value, offset

#: Functions that printed kernels may call. min and max are Python's, which let NaN through where it
#: comes first and drop it where it comes second: fmin and fmax would always drop it, and a joint
#: that has lost its numbers would look sound.
HELPERS = {
    "real_min": "real_t real_min(real_t a, real_t b) { return (b < a) ? b : a; }",
    "real_max": "real_t real_max(real_t a, real_t b) { return (b > a) ? b : a; }",
    "int_min": "int int_min(int a, int b) { return (b < a) ? b : a; }",
    "int_max": "int int_max(int a, int b) { return (b > a) ? b : a; }",
    "int_mod": "int int_mod(int a, int b) { return ((a % b) + b) % b; }",
    "int_floordiv": "int int_floordiv(int a, int b)"
    " { return (a / b) - (((a % b) != 0) && ((a < 0) != (b < 0)) ? 1 : 0); }",
    # What no int can hold becomes 0: to convert it is undefined in C.
    "real_int": "int real_int(real_t x)"
    " { return ((x > (real_t)-2e9) && (x < (real_t)2e9)) ? (int)x : 0; }",
    # By squaring, as numba does it.
    "real_ipow": """real_t real_ipow(real_t x, int k)
{
    real_t y = (real_t)1.0;
    for (int i = (k < 0) ? -k : k; i > 0; i /= 2) {
        y = ((i % 2) == 1) ? y * x : y;
        x *= x;
    }
    return (k < 0) ? (real_t)1.0 / y : y;
}""",
}

_RESERVED = """
    auto break case char const continue default do double else enum extern float for goto if
    inline int long register restrict return short signed sizeof static struct switch
    typedef union unsigned void volatile while main real_t
"""
_TAKEN = """
    abs acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc exp exp2 expm1
    fabs fdim floor fma fmax fmin fmod frexp gamma hypot ilogb isfinite isinf isnan j0 j1 jn ldexp
    lgamma log log10 log1p log2 logb lrint lround modf nearbyint pow remainder rint round scalbn
    sin sinh sqrt tan tanh tgamma trunc y0 y1 yn memcpy memset
    all_finite
"""


class C99(Language):
    """C99.

    Parameters
    ----------
    prefix
        Of the names of structs.
    """

    equal: Mapping[str, str] = {"==": "==", "!=": "!="}
    reserved = frozenset(_RESERVED.split())
    taken = frozenset(_TAKEN.split()) | frozenset(HELPERS)

    def __init__(self, prefix: str = "fpid_") -> None:
        self.prefix = prefix

    def truth(self, value: bool) -> str:
        """See `Language`."""
        return "1" if value else "0"

    def real(self, value: float) -> Value:
        """See `Language`."""
        text = repr(abs(value))
        if not math.isfinite(value):
            text = "NAN" if math.isnan(value) else "INFINITY"
        text = f"(real_t){text}"
        # 0 and -0 are different numbers.
        return Value(f"(-{text})" if math.copysign(1.0, value) < 0.0 else text, REAL, known=value)

    def convert(self, value: Value, kind: Number) -> Value:
        """See `Language`."""
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
        if isinstance(kind, (Record, Bundle)):
            return self.prefix + kind.name
        return "real_t" if kind == REAL else "int"

    def field(self, record: Value, name: str, place: int, kind: Number) -> Value:
        """See `Language`."""
        name = self.name(name)
        dot = f"{record.text[1:]}.{name}" if record.text.startswith("&") else ""
        return Value(dot or f"{record.text}->{name}", kind, ATOM, record.roots)

    def at(self, array: Value, index: Sequence[Value], kind: Kind) -> Value:
        """See `Language`."""
        assert isinstance(array.kind, Array)
        base = f"({array.text})" if array.text.startswith("&") else array.text
        text = f"{base}[{offset(array.kind, index).text}]"
        return Value(text if isinstance(kind, Number) else f"&{text}", kind, ATOM, array.roots)

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """See `Language`."""
        given = ", ".join(argument.text for argument in arguments)
        if kind == BOOL:
            return Value(f"{name}({given}) != 0", BOOL, COMPARISON)
        if name in ("min", "max", "mod", "floordiv"):
            return Value(f"{'int' if kind == INT else 'real'}_{name}({given})", kind)
        own = {"abs": "fabs", "int": "real_int", "ipow": "real_ipow"}
        return Value(f"{own.get(name, name)}({given})", kind)

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
            lines = [f"    {self.type_of(kind)} {self.name(name)};" for name, kind in record.kept]
            parts.append("\n".join(["typedef struct {", *lines, f"}} {self.type_of(record)};"]))
        return "\n\n".join(parts) + "\n"


def helpers(text: str) -> str:
    """Return the helpers that some functions call: a strict compiler refuses others."""
    used = [helper for name, helper in HELPERS.items() if f"{name}(" in text]
    return "".join(f"static inline {helper}\n" for helper in used)
