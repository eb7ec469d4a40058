"""Expressions of a kernel in another language, with their kinds."""

from __future__ import annotations

import ast
from collections.abc import Callable, Sequence
from typing import Any

from fpid_pin.export.kinds import BOOL, INT, REAL, Array, Kind, Number, Record, joined
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
    product,
)  # fmt: skip
from fpid_pin.export.source import Source, is_kernel

_ARITHMETIC = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT),
}  # fmt: skip
_COMPARE = {ast.Gt: ">", ast.Lt: "<", ast.GtE: ">=", ast.LtE: "<=", ast.Eq: "==", ast.NotEq: "!="}
_MATH = {"sqrt", "sin", "cos", "floor", "isfinite"}

#: Prints a kernel for the kinds that it is called with; returns its name, what it returns, and
#: which of its arguments it writes to.
Caller = Callable[[Any, Sequence[Kind], ast.AST, Source], tuple[str, Kind | None, list[bool]]]


class Expressions:
    """Translates the expressions of one kernel.

    Attributes
    ----------
    kinds
        Of the variables, as far as is known.
    written, used
        Names of variables through which memory is written; that are looked at.
    """

    def __init__(self, source: Source, language: Language, calls: Caller) -> None:
        self.source, self.language, self._calls = source, language, calls
        self.kinds: dict[str, Kind] = {}
        self.roots: dict[str, frozenset[str]] = {}
        self.written: set[str] = set()
        self.used: set[str] = set()

    def name(self, name: str) -> str:
        """Return how a variable is called, where the language has taken its name."""
        return f"{name}_v" if name in self.language.reserved else name

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
        if node.id in self.kinds:
            self.used.add(node.id)
            roots = self.roots.get(node.id, frozenset()) | {node.id}
            return Value(self.name(node.id), self.kinds[node.id], roots=roots)
        known = self.source.globals.get(node.id)
        if isinstance(known, (bool, int, float)):
            return self.language.number(known)
        raise self.refuse(node, f"{node.id}: expected a number or a variable that has a value")

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, ast.Mod):
            given = [self._whole(node.left), self._whole(node.right)]
            return self.language.call("mod", given, INT)
        if type(node.op) not in _ARITHMETIC:
            raise self.refuse(node, ast.unparse(node))
        sign, rank = _ARITHMETIC[type(node.op)]
        left, right = self.number(node.left), self.number(node.right)
        # A quotient of integers is a real number in Python.
        kind = REAL if sign == "/" else joined(_number(left), joined(_number(right), INT))
        left, right = self.language.coerce(left, kind), self.language.coerce(right, kind)
        return Value(f"{left.within(rank)} {sign} {right.within(rank + 1)}", kind, rank)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            truth = self.number(node.operand, BOOL)
            return Value(f"!{truth.within(UNARY)}", BOOL, UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(node, ast.unparse(node))
        value = self.number(node.operand)
        value = self.language.coerce(value, joined(_number(value), INT))
        return Value(f"-{value.within(UNARY + 1)}", value.kind, UNARY)

    def _boolop(self, node: ast.BoolOp) -> Value:
        sign, rank = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        # A compiler wants parentheses around && within ||.
        parts = [self.number(value, BOOL).within(COMPARISON) for value in node.values]
        return Value(f" {sign} ".join(parts), BOOL, rank)

    def _compare(self, node: ast.Compare) -> Value:
        if len(node.ops) > 1 or type(node.ops[0]) not in _COMPARE:
            raise self.refuse(node, ast.unparse(node))
        left, right = self.number(node.left), self.number(node.comparators[0])
        sign = _COMPARE[type(node.ops[0])]
        kind = joined(_number(left), joined(_number(right), INT))
        left, right = self.language.coerce(left, kind), self.language.coerce(right, kind)
        sign = self.language.equal.get(sign, sign)
        return Value(f"{left.within(SUM)} {sign} {right.within(SUM)}", BOOL, COMPARISON)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.number(node.test, BOOL)
        yes, no = self.number(node.body), self.number(node.orelse)
        kind = joined(_number(yes), _number(no))
        yes, no = self.language.coerce(yes, kind), self.language.coerce(no, kind)
        parts = [value.within(CHOICE + 1) for value in (test, yes, no)]
        return Value(f"{parts[0]} ? {parts[1]} : {parts[2]}", kind, CHOICE)

    # ------------------------------------------------------------------ memory

    def _attribute(self, node: ast.Attribute) -> Value:
        record = self.value(node.value)
        if isinstance(record.kind, Array) and node.attr == "size":
            return self._extent(node, record.kind, slice(None))
        if not isinstance(record.kind, Record):
            raise self.refuse(node, ast.unparse(node))
        place = record.kind.place(node.attr)
        if place is None:
            raise self.refuse(node, f"{node.attr} is no field of {record.kind}")
        return self.language.field(record, node.attr, place, record.kind.fields[place][1])

    def _extent(self, node: ast.AST, array: Array, part: slice) -> Value:
        extents = array.shape[part]
        if None in extents:
            raise self.refuse(node, "the size of a slice")
        return product(extents)

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
        if isinstance(index[0], ast.Slice) and len(index) == 1:
            return self._rows(node, array, index[0])
        return self.language.element(array, [self._whole(k) for k in index])

    def _rows(self, node: ast.AST, array: Value, rows: ast.Slice) -> Value:
        """Translate a slice of rows: an array that begins further on."""
        assert isinstance(array.kind, Array)
        if rows.step is not None or rows.lower is None or len(array.kind.shape) < 2:
            raise self.refuse(node, "a slice that is not one of whole rows, first:last")
        row = self.language.element(array, [self._whole(rows.lower)])
        assert isinstance(row.kind, Array)
        kind = Array(row.kind.element, (None, *row.kind.shape))
        return Value(row.text, kind, row.rank, row.roots)

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
            if not name.startswith("math.") or node.func.attr not in _MATH:
                raise self.refuse(node, name)
            kind = BOOL if node.func.attr == "isfinite" else REAL
            given = [self.number(argument, REAL) for argument in node.args]
            return self.language.call(node.func.attr, given, kind)
        if name in ("min", "max", "abs", "int") and name not in self.source.globals:
            return self._builtin(node, name)
        kernel = self.source.globals.get(name)
        if name in self.kinds or not is_kernel(kernel):
            raise self.refuse(node, f"{name}() is no kernel")
        values = [self.value(argument) for argument in node.args]
        called, kind_, writes = self._calls(kernel, [v.kind for v in values], node, self.source)
        for value, written in zip(values, writes, strict=True):
            if written:
                self.written |= value.roots
        text = f"{called}({', '.join(value.text for value in values)})"
        return text if kind_ is None else Value(text, kind_)

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


def _number(value: Value) -> Number:
    assert isinstance(value.kind, Number)
    return value.kind
