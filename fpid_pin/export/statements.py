"""Statements of a kernel in another language: blocks, loops, assignments."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from fpid_pin.export.expressions import Expressions
from fpid_pin.export.kinds import BOOL, INT, REAL, Kind, Number, joined
from fpid_pin.export.language import SUM, Language, Parameter, Value, zero
from fpid_pin.export.scopes import Scopes
from fpid_pin.export.source import Source

if TYPE_CHECKING:
    from fpid_pin.export.printer import Program

_AUGMENTED = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}
#: The kinds of variables may depend on one another; more rounds than any kernel needs.
_ROUNDS = 8


class Statements:
    """The body of one kernel, printed for given kinds of arguments.

    Attributes
    ----------
    lines
        The function's, without head and end.
    returns
        The kind of its value; None: none.
    parameters
        Its arguments, and what happens to them.
    """

    def __init__(
        self, source: Source, language: Language, program: Program, kinds: Sequence[Kind]
    ) -> None:
        self._source, self._language = source, language
        self._scopes = Scopes(source)
        self._x = Expressions(source, language, program)
        self._given = dict(zip(source.parameters, kinds, strict=True))
        self._x.kinds.update(self._given)
        self.returns: Kind | None = None
        # Kinds, and through which names memory is written, are known when nothing changes any more.
        for _ in range(_ROUNDS):
            before = (dict(self._x.kinds), set(self._x.written), self.returns)
            self._print()
            if before == (self._x.kinds, self._x.written, self.returns):
                break
        self._drop_unused()
        text = "\n".join(self.lines)
        self.parameters = [
            Parameter(p, kind, name in self._x.written, _uses(text, p))
            for name, kind in self._given.items()
            for p in [self._language.name(name)]
        ]

    def _print(self) -> None:
        self.lines: list[str] = []
        #: Names by the lines that declare them.
        self._declarations: dict[str, str] = {}
        self._depth, self._temporaries = 1, 0
        self._declared: set[str] = set()
        for name in self._scopes.hoisted:
            kind = self._x.kinds.get(name)
            if isinstance(kind, Number):
                start = self._language.number(zero(kind)).text
                self._line(f"{self._declare(name, kind)} = {start};")
                self._declarations[self.lines[-1]] = self._language.name(name)
            elif kind is not None:
                raise self._source.refusal(
                    self._source.tree, f"{name}: a record or row that outlives its block"
                )
            self._declared.add(name)
        for statement in self._source.body:
            self._statement(statement)

    def _drop_unused(self) -> None:
        """Drop variables that nothing is left of but where they begin."""
        for line, name in reversed(self._declarations.items()):
            others = "\n".join(other for other in self.lines if other != line)
            # A call may write.
            if not _uses(others, name) and not re.search(r"\w\(", line):
                self.lines = [other for other in self.lines if other != line]

    def _line(self, text: str) -> None:
        self.lines.append("    " * self._depth + text)

    def _declare(self, name: str, kind: Kind) -> str:
        return self._language.declare(self._language.name(name), kind, name not in self._x.written)

    # ------------------------------------------------------------------ statements

    def _statement(self, node: ast.stmt) -> None:
        method = getattr(self, f"_{type(node).__name__.lower()}", None)
        if method is None:
            first = ast.unparse(node).partition("\n")[0]
            raise self._x.refuse(node, f"{type(node).__name__}: {first}")
        method(node)

    def _block(self, body: Sequence[ast.stmt]) -> None:
        self._depth += 1
        # What a block declares is gone where it ends.
        before = set(self._declared)
        for statement in body:
            self._statement(statement)
        self._declared = before
        self._depth -= 1

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Call):
            raise self._x.refuse(node, ast.unparse(node))
        found = self._x.call(node.value)
        self._line(f"{found if isinstance(found, str) else found.text};")

    def _continue(self, node: ast.Continue) -> None:
        self._line("continue;")

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            raise self._x.refuse(node, "a return without a value")
        value = self._x.number(node.value)
        assert isinstance(value.kind, Number)
        if self.returns is None:
            self.returns = value.kind
        assert isinstance(self.returns, Number)
        self.returns = joined(self.returns, value.kind)
        self._line(f"return {self._language.coerce(value, self.returns).text};")

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _if(self, node: ast.If) -> None:
        word = "if"
        while True:
            test = self._x.number(node.test, BOOL)
            left: list[ast.stmt] = node.orelse
            if test.known is not None:
                # Only what can ever happen is printed.
                left = node.body if test.known else node.orelse
                if word == "if":
                    for statement in left:
                        self._statement(statement)
                    return
                break
            self._line(f"{word} ({test.text}) {{")
            self._block(node.body)
            if len(left) != 1 or not isinstance(left[0], ast.If):
                break
            node, word = left[0], "} else if"
        if left:
            self._line("} else {")
            self._block(left)
        self._line("}")

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise self._x.refuse(node, "while with else")
        self._line(f"while ({self._x.number(node.test, BOOL).text}) {{")
        self._block(node.body)
        self._line("}")

    def _for(self, node: ast.For) -> None:
        made, target = node.iter, node.target
        if (
            not isinstance(target, ast.Name)
            or not isinstance(made, ast.Call)
            or ast.unparse(made.func) != "range"
            or len(made.args) not in (1, 2)
            or node.orelse
        ):
            raise self._x.refuse(node, f"expected for NAME in range(...), got {_head(node)}")
        ends = [self._x.number(end) for end in made.args]
        for end, argument in zip(ends, made.args, strict=True):
            if end.kind != INT:
                raise self._x.refuse(argument, f"expected an integer, got {ast.unparse(argument)}")
        if ends[-1].known is None and ast.unparse(made.args[-1]) not in self._scopes.steady:
            # Python asks only once where it ends.
            ends[-1] = self._keep(ends[-1])
        start = ends[0].text if len(ends) == 2 else "0"
        first, last = (ends[0].known, ends[-1].known) if len(ends) == 2 else (0, ends[0].known)
        if first is not None and last is not None and first >= last:
            return
        name = target.id
        kept = self._x.kinds.get(name)
        self._x.kinds[name] = INT
        self._line(self._language.loop(self._language.name(name), start, ends[-1].within(SUM)))
        self._block(node.body)
        self._line("}")
        # Its name is its own: the same may stand for something else elsewhere.
        if kept is None:
            del self._x.kinds[name]
        else:
            self._x.kinds[name] = kept

    # ------------------------------------------------------------------ assignments

    def _assign(self, node: ast.Assign) -> None:
        if len(node.targets) > 1:
            value = self._x.value(node.value)
            if not isinstance(node.value, ast.Constant):
                value = self._keep(value)
            for target in node.targets:
                self._store(target, value)
        elif isinstance(node.targets[0], ast.Tuple):
            self._unpack(node, node.targets[0])
        else:
            self._store(node.targets[0], self._x.value(node.value))

    def _unpack(self, node: ast.Assign, target: ast.Tuple) -> None:
        """Assign one by one, by way of variables where a later value would see an earlier name."""
        if not isinstance(node.value, ast.Tuple) or len(node.value.elts) != len(target.elts):
            raise self._x.refuse(node, f"expected as many values as names: {ast.unparse(node)}")
        pairs = list(zip(target.elts, node.value.elts, strict=True))
        tangled = any(
            self._scopes.touches(earlier, value)
            for k, (_, value) in enumerate(pairs)
            for earlier, _ in pairs[:k]
        )
        if tangled:
            kept = [self._keep(self._x.value(value)) for _, value in pairs]
            for (place, _), known in zip(pairs, kept, strict=True):
                self._store(place, known)
        else:
            for place, value in pairs:
                self._store(place, self._x.value(value))

    def _keep(self, value: Value) -> Value:
        """Give a value a name."""
        self._temporaries += 1
        name = f"kept_{self._temporaries}"
        self._line(f"{self._language.declare(name, value.kind, False)} = {value.text};")
        return Value(name, value.kind, roots=value.roots)

    def _store(self, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._store_name(target, value)
            return
        if not isinstance(target, (ast.Attribute, ast.Subscript)):
            raise self._x.refuse(target, ast.unparse(target))
        place = self._x.value(target)
        if not isinstance(place.kind, Number) or not isinstance(value.kind, Number):
            raise self._x.refuse(target, f"an assignment to {place.kind}: {ast.unparse(target)}")
        if value.kind == REAL and place.kind != REAL:
            raise self._x.refuse(target, f"a real number in an integer: {ast.unparse(target)}")
        self._x.written |= place.roots
        self._line(f"{place.text} = {self._language.coerce(value, place.kind).text};")

    def _store_name(self, target: ast.Name, value: Value) -> None:
        name, kind = target.id, self._x.kinds.get(target.id)
        if isinstance(value.kind, Number) and isinstance(kind, Number):
            kind = joined(kind, value.kind)
        elif kind is not None and kind != value.kind:
            raise self._x.refuse(target, f"{name} is first {kind}, then {value.kind}")
        else:
            kind = value.kind
        if self._given.get(name, kind) != kind:
            raise self._x.refuse(target, f"{name} is given as {self._given[name]}, then {kind}")
        if value.known is not None and kind in (INT, BOOL) and name in self._scopes.steady:
            self._x.fixed[name] = value
            return
        self._x.kinds[name] = kind
        if isinstance(kind, Number):
            value = self._language.coerce(value, kind)
        else:
            self._x.roots[name] = self._x.roots.get(name, frozenset()) | value.roots
        own = name in self._given or name in self._declared
        self._declared.add(name)
        left = self._language.name(name) if own else self._declare(name, kind)
        self._line(f"{left} = {value.text};")
        if not own:
            self._declarations[self.lines[-1]] = self._language.name(name)

    def _augassign(self, node: ast.AugAssign) -> None:
        if type(node.op) not in _AUGMENTED:
            raise self._x.refuse(node, ast.unparse(node))
        target, value = self._x.number(node.target), self._x.number(node.value)
        assert isinstance(target.kind, Number)
        if target.kind != REAL and (value.kind == REAL or isinstance(node.op, ast.Div)):
            if not isinstance(node.target, ast.Name) or node.target.id in self._given:
                raise self._x.refuse(node, f"a real number in an integer: {ast.unparse(node)}")
            # It is real from the start, then.
            self._x.kinds[node.target.id] = REAL
            target = self._x.number(node.target)
        if not isinstance(node.target, ast.Name):
            self._x.written |= target.roots
        assert isinstance(target.kind, Number)
        right = self._language.coerce(value, target.kind)
        self._line(f"{target.text} {_AUGMENTED[type(node.op)]} {right.text};")


def _uses(text: str, name: str) -> bool:
    """Return whether a name occurs in some lines."""
    return re.search(rf"\b{name}\b", text) is not None


def _head(node: ast.For) -> str:
    return ast.unparse(node).partition("\n")[0]
