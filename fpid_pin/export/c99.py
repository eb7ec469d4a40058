"""Kernels in C99: records are structs, arrays are pointers to their first element.

`real_t` is double or float; <tgmath.h> finds the functions of either. Every constant is cast to it,
so that no operation is made in a precision that was not asked for, and integers become real where
they meet reals, visibly.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import ClassVar

from fpid_pin.export.kinds import INT, REAL, Array, Kind, Number, Rank, Record, Value, offset

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


class C99:
    """What depends on the language: numbers, memory, declarations, functions.

    JavaScript is a subclass: blocks, loops and conditional expressions it writes alike.
    """

    #: Names of functions that are called otherwise than in Python.
    functions: ClassVar[Mapping[str, str]] = {"abs": "fabs", "int": "real_int", "ipow": "real_ipow"}
    #: Names that no variable may have; and, with `taken`, no function.
    reserved: ClassVar = frozenset(_RESERVED.split())
    taken: ClassVar = frozenset(_TAKEN.split()) | frozenset(HELPERS)

    def number(self, value: bool | float) -> Value:
        """Return a constant."""
        if isinstance(value, float):
            return self.real(value)
        return Value(str(int(value)), INT, Rank.ATOM if value >= 0 else Rank.UNARY, value)

    def real(self, value: float) -> Value:
        """Return a real constant, to the last bit."""
        text = f"(real_t){abs(value)!r}".replace("inf", "INFINITY").replace("nan", "NAN")
        # 0 and -0 are different numbers.
        negative = math.copysign(1.0, value) < 0.0
        return Value(f"(-{text})" if negative else text, REAL, Rank.ATOM, value)

    def to_real(self, value: Value) -> Value:
        """Return an integer as a real number."""
        return Value(f"(real_t){value.within(Rank.ATOM)}", REAL)

    def coerce(self, value: Value, kind: Number) -> Value:
        """Return a number as one of another kind: an integer as a real one."""
        if kind == REAL and value.kind == INT:
            return self.to_real(value) if value.known is None else self.real(float(value.known))
        return value

    def name(self, name: str) -> str:
        """Return how a variable or a field is called, where the language has taken its name."""
        return f"{name}_v" if name in self.reserved else name

    def type_of(self, kind: Kind) -> str:
        """Return the name of a type, a pointer's without its star."""
        if isinstance(kind, Array):
            return self.type_of(kind.element)
        if isinstance(kind, Number):
            return "real_t" if kind == REAL else "int"
        return f"fpid_{kind.name}"

    def field(self, record: Value, place: int, name: str, kind: Number) -> Value:
        """Return a field of a record, which is the one at a place among its fields."""
        text, name = record.text, self.name(name)
        return Value(f"{text[1:]}.{name}" if text.startswith("&") else f"{text}->{name}", kind)

    def element(self, array: Value, index: Sequence[Value], part: Array | None = None) -> Value:
        """Return an element of an array, or a row of it, or a `part` that begins there."""
        kind = array.kind
        assert isinstance(kind, Array)
        rest = kind.shape[len(index) :]
        row = Array(kind.element, rest, fixed=kind.fixed) if rest else kind.element
        return self.at(array, kind, index, part or row)

    def at(self, array: Value, kind: Array, index: Sequence[Value], found: Kind) -> Value:
        """Return what begins at an element of an array: the number there, or its address."""
        base = f"({array.text})" if array.text.startswith("&") else array.text
        text = f"{base}[{offset(kind, index).text}]"
        return Value(text if isinstance(found, Number) else f"&{text}", found)

    def call(self, name: str, arguments: Sequence[Value], kind: Number) -> Value:
        """Call `min`, `max`, `abs`, `int`, `mod`, `floordiv`, `ipow` or a function of `math`."""
        if name in ("min", "max", "mod", "floordiv"):
            name = f"{'int' if kind == INT else 'real'}_{name}"
        given = ", ".join(argument.text for argument in arguments)
        return Value(f"{self.functions.get(name, name)}({given})", kind)

    def declare(self, name: str, kind: Kind) -> str:
        """Return a declaration up to the name."""
        if isinstance(kind, Number):
            return f"{self.type_of(kind)} {name}"
        constant = "const " if isinstance(kind, (Array, Record)) and kind.fixed else ""
        return f"{constant}{self.type_of(kind)} *{name}"

    def head(
        self, name: str, parameters: Mapping[str, Kind], returns: Kind | None, unused: Sequence[str]
    ) -> list[str]:
        """Return the lines that open a function, which does not look at `unused` parameters."""
        given = ", ".join(self.declare(*parameter) for parameter in parameters.items()) or "void"
        result = "void" if returns is None else self.type_of(returns)
        says = [f"    (void){parameter};" for parameter in unused]
        return [f"static {result} {name}({given})", "{", *says]

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
