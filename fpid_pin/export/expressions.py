"""Expressions of a kernel in another language, with their kinds."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Bundle, Kind, Number, Record, joined
from fpid_pin.export.language import (
    AND,
    CHOICE,
    COMPARISON,
    OR,
    PRODUCT,
    SUM,
    UNARY,
    Language,
    Value,
)  # fmt: skip
from fpid_pin.export.source import Source, is_kernel

if TYPE_CHECKING:
    from fpid_pin.export.printer import Program

_ARITHMETIC = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT),
    ast.BitAnd: ("&", AND),
}  # fmt: skip
_COMPARE = {ast.Gt: ">", ast.Lt: "<", ast.GtE: ">=", ast.LtE: "<=", ast.Eq: "==", ast.NotEq: "!="}
_FOLDED = {
    "+": operator.add, "-": operator.sub, "*": operator.mul, ">": operator.gt, "<": operator.lt,
    ">=": operator.ge, "<=": operator.le, "==": operator.eq, "!=": operator.ne, "&": operator.and_,
}  # fmt: skip
_MATH = """
    sqrt exp expm1 log log1p pow sin cos tan asin acos atan atan2 sinh cosh tanh hypot floor ceil
    fabs copysign isfinite isnan
"""


class Expressions:
    """Translates the expressions of one kernel.

    Attributes
    ----------
    kinds
        Of the variables, as far as is known.
    fixed
        Values of variables that are constants.
    written
        Names of variables through which memory is written.
    """

    def __init__(self, source: Source, language: Language, program: Program) -> None:
        self.source, self.language, self._program = source, language, program
        self.kinds: dict[str, Kind] = {}
        self.roots: dict[str, frozenset[str]] = {}
        self.fixed: dict[str, Value] = {}
        self.written: set[str] = set()

    def refuse(self, node: ast.AST, what: str) -> Exception:
        """Return the error that says what cannot be printed, and where."""
        return self.source.refusal(node, what)

    # ------------------------------------------------------------------ any expression

    def value(self, node: ast.expr) -> Value:
        """Translate an expression."""
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            raise self.refuse(node, f"{type(node).__name__}: {ast.unparse(node)}")
        found: Value = method(node)
        return found

    def number(self, node: ast.expr, kind: Number | None = None) -> Value:
        """Translate an expression that is a number, of a given kind if any."""
        value = self.value(node)
        if not isinstance(value.kind, Number):
            raise self.refuse(node, f"expected a number, got {value.kind}: {ast.unparse(node)}")
        return value if kind is None else self.language.coerce(value, kind)

    def _whole(self, node: ast.expr) -> Value:
        value = self.number(node)
        if value.kind == REAL:
            raise self.refuse(node, f"expected an integer, got {ast.unparse(node)}")
        return self.language.coerce(value, INT)

    def _constant(self, node: ast.Constant) -> Value:
        if not isinstance(node.value, (bool, int, float)):
            raise self.refuse(node, f"the constant {node.value!r}")
        return self.language.number(node.value)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.fixed:
            return self.fixed[node.id]
        if node.id in self.kinds:
            roots = self.roots.get(node.id, frozenset()) | {node.id}
            return Value(self.language.name(node.id), self.kinds[node.id], roots=roots)
        known = self.source.globals.get(node.id)
        if isinstance(known, (bool, int, float)):
            return self.language.number(known)
        raise self.refuse(node, f"{node.id}: expected a number or a variable that has a value")

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, (ast.Mod, ast.FloorDiv)):
            given = [self._whole(node.left), self._whole(node.right)]
            name = "mod" if isinstance(node.op, ast.Mod) else "floordiv"
            return self.language.call(name, given, INT)
        if isinstance(node.op, ast.Pow):
            base, power = self.number(node.left, REAL), self.number(node.right)
            if power.kind == INT:
                return self.language.call("ipow", [base, power], REAL)
            return self.language.call("pow", [base, self.language.coerce(power, REAL)], REAL)
        if type(node.op) not in _ARITHMETIC:
            raise self.refuse(node, ast.unparse(node))
        sign, rank = _ARITHMETIC[type(node.op)]
        each = self._whole if sign == "&" else self.number
        left, right = each(node.left), each(node.right)
        # A quotient of integers is a real number in Python.
        kind = REAL if sign == "/" else joined(_number(left), joined(_number(right), INT))
        left, right = self.language.coerce(left, kind), self.language.coerce(right, kind)
        if kind == INT and left.known is not None and right.known is not None:
            return self.language.number(_FOLDED[sign](left.known, right.known))
        return Value(f"{left.within(rank)} {sign} {right.within(rank + 1)}", kind, rank)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            truth = self.number(node.operand, BOOL)
            if truth.known is not None:
                return self.language.number(not truth.known)
            return Value(f"!{truth.within(UNARY)}", BOOL, UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(node, ast.unparse(node))
        value = self.number(node.operand)
        value = self.language.coerce(value, joined(_number(value), INT))
        if value.kind == INT and value.known is not None:
            return self.language.number(-value.known)
        return Value(f"-{value.within(UNARY + 1)}", value.kind, UNARY)

    def _boolop(self, node: ast.BoolOp) -> Value:
        ends = isinstance(node.op, ast.Or)
        sign, rank = ("||", OR) if ends else ("&&", AND)
        parts = [self.number(value, BOOL) for value in node.values]
        decided = next((k for k, part in enumerate(parts) if part.known is ends), None)
        # A call before it is made all the same.
        if decided is not None and not any(map(_calls, node.values[:decided])):
            return self.language.number(ends)
        parts = [part for part in parts if part.known is not (not ends)]
        if len(parts) < 2:
            return parts[0] if parts else self.language.number(not ends)
        # A compiler wants parentheses around && within ||.
        return Value(f" {sign} ".join(part.within(COMPARISON) for part in parts), BOOL, rank)

    def _compare(self, node: ast.Compare) -> Value:
        if len(node.ops) > 1 or type(node.ops[0]) not in _COMPARE:
            raise self.refuse(node, ast.unparse(node))
        left, right = self.number(node.left), self.number(node.comparators[0])
        sign = _COMPARE[type(node.ops[0])]
        kind = joined(_number(left), joined(_number(right), INT))
        left, right = self.language.coerce(left, kind), self.language.coerce(right, kind)
        if left.known is not None and right.known is not None:
            return self.language.number(bool(_FOLDED[sign](left.known, right.known)))
        sign = self.language.equal.get(sign, sign)
        return Value(f"{left.within(SUM)} {sign} {right.within(SUM)}", BOOL, COMPARISON)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.number(node.test, BOOL)
        if test.known is not None:
            return self.number(node.body if test.known else node.orelse)
        yes, no = self.number(node.body), self.number(node.orelse)
        kind = joined(_number(yes), _number(no))
        yes, no = self.language.coerce(yes, kind), self.language.coerce(no, kind)
        parts = [value.within(CHOICE + 1) for value in (test, yes, no)]
        return Value(f"{parts[0]} ? {parts[1]} : {parts[2]}", kind, CHOICE)

    # ------------------------------------------------------------------ memory

    def _attribute(self, node: ast.Attribute) -> Value:
        name = node.attr
        if ast.unparse(node.value) == "math" and isinstance(getattr(math, name, None), float):
            return self.language.number(getattr(math, name))
        record = self.value(node.value)
        if isinstance(record.kind, Array) and name == "size":
            return self._extent(node, record.kind, slice(None))
        if isinstance(record.kind, Bundle):
            found = [member for member in record.kind.members if member[0] == name]
            if not found:
                raise self.refuse(node, f"{name} is no array of {record.kind}")
            return Value(found[0][2].format(record.text), found[0][1], roots=record.roots)
        if not isinstance(record.kind, Record):
            raise self.refuse(node, ast.unparse(node))
        place = record.kind.place(name)
        if place is None:
            raise self.refuse(node, f"{name} is no field of {record.kind}")
        known = dict(record.kind.constants).get(name)
        if known is not None:
            return self.language.number(known)
        return self.language.field(record, name, place, record.kind.fields[place][1])

    def _extent(self, node: ast.AST, array: Array, part: slice) -> Value:
        extents = array.shape[part]
        if None in extents:
            raise self.refuse(node, "the size of a slice")
        return self.language.number(math.prod(extent or 0 for extent in extents))

    def _subscript(self, node: ast.Subscript) -> Value:
        asked = node.value
        if isinstance(asked, ast.Attribute) and asked.attr == "shape":
            array, axis = self.value(asked.value), node.slice
            number = axis.value if isinstance(axis, ast.Constant) else None
            if not isinstance(array.kind, Array) or not isinstance(number, int):
                raise self.refuse(node, ast.unparse(node))
            return self._extent(node, array.kind, slice(number, number + 1))
        array = self.value(node.value)
        if not isinstance(array.kind, Array):
            raise self.refuse(node, f"an index of {array.kind}: {ast.unparse(node)}")
        index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(index) > len(array.kind.shape):
            raise self.refuse(node, f"more indices than dimensions: {ast.unparse(node)}")
        if any(isinstance(k, ast.Slice) for k in index):
            return self._part(node, array, index)
        return self.language.element(array, [self._whole(k) for k in index])

    def _part(self, node: ast.AST, array: Value, index: Sequence[ast.expr]) -> Value:
        """Translate ``x[first:last]`` or ``x[:, first:last]``: an array that begins further on."""
        kind, part = array.kind, index[-1]
        assert isinstance(kind, Array)
        columns = [ast.unparse(k) for k in index[:-1]] == [":"]
        if not isinstance(part, ast.Slice) or part.step or not (columns or len(index) == 1):
            raise self.refuse(node, "a slice that is not one of rows or of columns, first:last")
        zero, axis = self.language.number(0), 1 if columns else 0
        first = zero if part.lower is None else self._whole(part.lower)
        last = None if part.upper is None else self._whole(part.upper).known
        end = kind.shape[axis] if part.upper is None else last
        extent = None if end is None or first.known is None else int(end - first.known)
        shape = (*kind.shape[:axis], extent, *kind.shape[axis + 1 :])
        pitch = (kind.pitch or kind.shape[1]) if columns else kind.pitch
        at = [zero, first] if columns else [first]
        return self.language.element(array, at, Array(kind.element, shape, pitch))

    # ------------------------------------------------------------------ calls

    def _call(self, node: ast.Call) -> Value:
        value = self.call(node)
        if value is None or not isinstance(value, Value):
            raise self.refuse(node, f"{ast.unparse(node.func)} returns nothing")
        return value

    def call(self, node: ast.Call) -> Value | str:
        """Translate a call; a text is one of a kernel that returns nothing."""
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self.refuse(node, f"arguments other than plain ones: {ast.unparse(node)}")
        name = ast.unparse(node.func)
        if isinstance(node.func, ast.Attribute):
            if not name.startswith("math.") or node.func.attr not in _MATH.split():
                raise self.refuse(node, name)
            kind = BOOL if node.func.attr.startswith("is") else REAL
            given = [self.number(argument, REAL) for argument in node.args]
            return self.language.call(node.func.attr, given, kind)
        if name in ("min", "max", "abs", "int") and name not in self.source.globals:
            return self._builtin(node, name)
        kernel, arguments = self._program.instead(self.source.globals.get(name), node.args)
        if name in self.kinds or not is_kernel(kernel):
            raise self.refuse(node, f"{name}() is no kernel")
        values = [self.value(argument) for argument in arguments]
        kinds = [value.kind for value in values]
        printed = self._program.add(kernel, kinds, node, self.source)
        taken = [(v, p) for v, p in zip(values, printed.parameters, strict=True) if p.taken]
        self.written.update(*(v.roots for v, p in taken if p.written))
        text = f"{printed.name}({', '.join(v.text for v, _ in taken)})"
        return text if printed.returns is None else Value(text, printed.returns)

    def _builtin(self, node: ast.Call, name: str) -> Value:
        given = [self.number(argument) for argument in node.args]
        if len(given) != (2 if name in ("min", "max") else 1):
            raise self.refuse(node, f"{name} of {len(given)} numbers")
        if name == "int":
            real = given[0].kind == REAL
            return self.language.call("int", given, INT) if real else given[0]
        kind = INT if name != "abs" else REAL
        for value in given:
            kind = joined(kind, _number(value)) if value.kind != BOOL else kind
        return self.language.call(name, [self.language.coerce(v, kind) for v in given], kind)


def _calls(node: ast.expr) -> bool:
    """Return whether an expression has a call in it, which may write."""
    return any(isinstance(part, ast.Call) for part in ast.walk(node))


def _number(value: Value) -> Number:
    assert isinstance(value.kind, Number)
    return value.kind
