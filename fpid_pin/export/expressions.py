"""Expressions of a kernel in another language, with their kinds."""

import ast
import math
import operator
from collections.abc import Sequence

from fpid_pin.export.c99 import C99
from fpid_pin.export.kinds import INT, REAL, Array, Bundle, Kind, Number, Rank, Record, Value
from fpid_pin.export.source import Source

#: Operators that all three languages have: how they are written, how tightly they hold, and what
#: they make of constants.
_OPERATORS = {
    ast.Add: ("+", Rank.SUM, operator.add), ast.Sub: ("-", Rank.SUM, operator.sub),
    ast.Mult: ("*", Rank.PRODUCT, operator.mul), ast.Div: ("/", Rank.PRODUCT, None),
    ast.BitAnd: ("&", Rank.AND, operator.and_),
    ast.Gt: (">", Rank.COMPARISON, operator.gt), ast.Lt: ("<", Rank.COMPARISON, operator.lt),
    ast.GtE: (">=", Rank.COMPARISON, operator.ge), ast.LtE: ("<=", Rank.COMPARISON, operator.le),
    ast.Eq: ("==", Rank.COMPARISON, operator.eq), ast.NotEq: ("!=", Rank.COMPARISON, operator.ne),
}  # fmt: skip


class Expressions:
    """Translates the expressions of one kernel."""

    def __init__(self, source: Source, language: C99) -> None:
        self.source, self.language = source, language
        #: Of the variables, as far as is known; values of those that are constants.
        self.kinds: dict[str, Kind] = {}
        self.fixed: dict[str, Value] = {}

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

    def number(self, node: ast.expr) -> Value:
        """Translate an expression that is a number."""
        value = self.value(node)
        if not isinstance(value.kind, Number):
            raise self.refuse(node, f"expected a number, got {value.kind}: {ast.unparse(node)}")
        return value

    def real(self, node: ast.expr) -> Value:
        """Translate an expression to a real number."""
        return self.language.coerce(self.number(node), REAL)

    def whole(self, node: ast.expr) -> Value:
        """Translate an expression that is an integer."""
        value = self.number(node)
        if value.kind == REAL:
            raise self.refuse(node, f"expected an integer, got {ast.unparse(node)}")
        return value

    def truth(self, node: ast.expr) -> Value:
        """Translate an expression to whether it is true."""
        value = self.number(node)
        if value.known is not None:
            return self.language.number(bool(value.known))
        if value.kind == REAL:
            return Value(f"{value.within(Rank.SUM)} != 0", INT, Rank.COMPARISON)
        return value

    def alike(self, *nodes: ast.expr) -> list[Value]:
        """Translate numbers that are to be of one kind."""
        values = [self.number(node) for node in nodes]
        kind = REAL if any(value.kind == REAL for value in values) else INT
        return [self.language.coerce(value, kind) for value in values]

    def _constant(self, node: ast.Constant) -> Value:
        if not isinstance(node.value, (bool, int, float)):
            raise self.refuse(node, f"the constant {node.value!r}")
        return self.language.number(node.value)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.fixed:
            return self.fixed[node.id]
        if node.id in self.kinds:
            return Value(self.language.name(node.id), self.kinds[node.id])
        known = self.source.globals.get(node.id)
        if isinstance(known, (bool, int, float)):
            return self.language.number(known)
        raise self.refuse(node, f"{node.id}: expected a number or a variable that has a value")

    def _binop(self, node: ast.BinOp) -> Value:
        if isinstance(node.op, (ast.Mod, ast.FloorDiv)):
            name = "mod" if isinstance(node.op, ast.Mod) else "floordiv"
            return self.language.call(name, [self.whole(node.left), self.whole(node.right)], INT)
        if isinstance(node.op, ast.Pow):
            base, power = self.real(node.left), self.number(node.right)
            return self.language.call("ipow" if power.kind == INT else "pow", [base, power], REAL)
        return self._combined(node, node.op, node.left, node.right)

    def _compare(self, node: ast.Compare) -> Value:
        if len(node.ops) > 1:
            raise self.refuse(node, ast.unparse(node))
        return self._combined(node, node.ops[0], node.left, node.comparators[0])

    def _combined(
        self, node: ast.expr, between: ast.operator | ast.cmpop, left: ast.expr, right: ast.expr
    ) -> Value:
        """Translate an operation on two numbers."""
        if type(between) not in _OPERATORS:
            raise self.refuse(node, ast.unparse(node))
        sign, rank, fold = _OPERATORS[type(between)]
        # A quotient of integers is a real number in Python.
        each = {"&": self.whole, "/": self.real}.get(sign)
        a, b = (each(left), each(right)) if each else self.alike(left, right)
        kind = INT if rank == Rank.COMPARISON else a.kind
        if fold and a.known is not None and b.known is not None and INT in (kind, a.kind):
            return self.language.number(fold(a.known, b.known))
        # A compiler wants parentheses around comparisons within &.
        inner = (Rank.SUM, Rank.SUM) if rank in (Rank.COMPARISON, Rank.AND) else (rank, rank + 1)
        return Value(f"{a.within(inner[0])} {sign} {b.within(inner[1])}", kind, rank)

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            truth = self.truth(node.operand)
            if truth.known is not None:
                return self.language.number(not truth.known)
            return Value(f"!{truth.within(Rank.UNARY)}", INT, Rank.UNARY)
        if not isinstance(node.op, ast.USub):
            raise self.refuse(node, ast.unparse(node))
        value = self.number(node.operand)
        if value.kind == INT and value.known is not None:
            return self.language.number(-value.known)
        return Value(f"-{value.within(Rank.UNARY + 1)}", value.kind, Rank.UNARY)

    def _boolop(self, node: ast.BoolOp) -> Value:
        ends = isinstance(node.op, ast.Or)
        sign, rank = ("||", Rank.OR) if ends else ("&&", Rank.AND)
        parts = [self.truth(value) for value in node.values]
        decided = next((k for k, part in enumerate(parts) if part.known is ends), None)
        # A call before it is made all the same.
        if decided is not None and not any(map(_calls, node.values[:decided])):
            return self.language.number(ends)
        parts = [part for part in parts if part.known is not (not ends)]
        if len(parts) < 2:
            return parts[0] if parts else self.language.number(not ends)
        # A compiler wants parentheses around && within ||.
        return Value(f" {sign} ".join(part.within(Rank.COMPARISON) for part in parts), INT, rank)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.truth(node.test)
        if test.known is not None:
            return self.number(node.body if test.known else node.orelse)
        yes, no = self.alike(node.body, node.orelse)
        parts = [value.within(Rank.CHOICE + 1) for value in (test, yes, no)]
        return Value(f"{parts[0]} ? {parts[1]} : {parts[2]}", yes.kind, Rank.CHOICE)

    # ------------------------------------------------------------------ memory

    def _attribute(self, node: ast.Attribute) -> Value:
        name = node.attr
        if ast.unparse(node.value) == "math" and isinstance(getattr(math, name, None), float):
            return self.language.number(getattr(math, name))
        record = self.value(node.value)
        if isinstance(record.kind, Array) and name == "size":
            return self._extent(node, record.kind.shape)
        if isinstance(record.kind, Bundle):
            for member, kind, text in record.kind.members:
                if member == name:
                    return Value(text.format(record.text), kind)
            raise self.refuse(node, f"{name} is no array of {record.kind}")
        if not isinstance(record.kind, Record):
            raise self.refuse(node, ast.unparse(node))
        fields = dict(record.kind.fields)
        if name not in fields:
            raise self.refuse(node, f"{name} is no field of {record.kind}")
        known = dict(record.kind.constants).get(name)
        if known is not None:
            return self.language.number(known)
        return self.language.field(record, list(fields).index(name), name, fields[name])

    def _extent(self, node: ast.AST, extents: Sequence[int | None]) -> Value:
        if None in extents:
            raise self.refuse(node, "the size of a slice")
        return self.language.number(math.prod(extent or 0 for extent in extents))

    def _subscript(self, node: ast.Subscript) -> Value:
        asked = node.value
        if isinstance(asked, ast.Attribute) and asked.attr == "shape":
            array, axis = self.value(asked.value), node.slice
            if not isinstance(array.kind, Array) or not isinstance(axis, ast.Constant):
                raise self.refuse(node, ast.unparse(node))
            return self._extent(node, [array.kind.shape[int(str(axis.value))]])
        array = self.value(asked)
        if not isinstance(array.kind, Array):
            raise self.refuse(node, f"an index of {array.kind}: {ast.unparse(node)}")
        index = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        if len(index) > len(array.kind.shape):
            raise self.refuse(node, f"more indices than dimensions: {ast.unparse(node)}")
        if any(isinstance(k, ast.Slice) for k in index):
            return self._part(node, array, array.kind, index)
        return self.language.element(array, [self.whole(k) for k in index])

    def _part(self, node: ast.AST, array: Value, kind: Array, index: Sequence[ast.expr]) -> Value:
        """Translate ``x[first:last]`` or ``x[:, first:last]``: an array that begins further on."""
        part = index[-1]
        columns = [ast.unparse(k) for k in index[:-1]] == [":"]
        if not isinstance(part, ast.Slice) or part.step or not (columns or len(index) == 1):
            raise self.refuse(node, "a slice that is not one of rows or of columns, first:last")
        zero, axis = self.language.number(0), 1 if columns else 0
        first = self.whole(part.lower) if part.lower else zero
        end = self.whole(part.upper).known if part.upper else kind.shape[axis]
        extent = None if end is None or first.known is None else int(end - first.known)
        shape = (*kind.shape[:axis], extent, *kind.shape[axis + 1 :])
        pitch = (kind.pitch or kind.shape[1]) if columns else kind.pitch
        at = [zero, first] if columns else [first]
        return self.language.element(array, at, Array(kind.element, shape, pitch, kind.fixed))


def _calls(node: ast.expr) -> bool:
    """Return whether an expression has a call in it, which may write."""
    return any(isinstance(part, ast.Call) for part in ast.walk(node))
