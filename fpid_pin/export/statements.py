"""Statements of a kernel in another language: blocks, loops, assignments."""

from __future__ import annotations

import ast
import re
from collections.abc import Sequence

from fpid_pin.export.c99 import C99
from fpid_pin.export.expressions import Expressions, Kernels
from fpid_pin.export.kinds import INT, REAL, SUM, Kind, Number, Value
from fpid_pin.export.source import Source

_AUGMENTED = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}
#: The kinds of variables may depend on one another; more rounds than any kernel needs.
_ROUNDS = 8


class Statements(Expressions):
    """The body of one kernel, printed for given kinds of arguments: its lines, and its value."""

    def __init__(
        self, source: Source, language: C99, kernels: Kernels, kinds: Sequence[Kind]
    ) -> None:
        super().__init__(source, language, kernels)
        self._given = dict(zip(source.parameters, kinds, strict=True))
        self.kinds.update(self._given)
        self.returns: Number | None = None
        self.lines: list[str] = []
        # Kinds are known when nothing changes any more.
        for _ in range(_ROUNDS):
            before = (dict(self.kinds), self.returns)
            self._print()
            if before == (self.kinds, self.returns):
                break
        names = [language.name(name) for name in self.kinds if name not in self._given]
        names += [f"kept_{k + 1}" for k in range(self._temporaries)]
        self.lines = _without_unused(self.lines, names)

    def uses(self, name: str) -> bool:
        """Return whether a variable occurs in the printed lines."""
        return _count(self.language.name(name), self.lines) > 0

    def _print(self) -> None:
        self.lines = []
        self._depth, self._temporaries = 1, 0
        for name in self.source.hoisted:
            if name in self.kinds:
                kind = self.kinds[name]
                declared = self.language.declare(self.language.name(name), kind)
                # The address 0 as well as the number.
                self._line(f"{declared} = 0;")
        self._all(self.source.body)

    def _line(self, text: str) -> None:
        self.lines.append("    " * self._depth + text)

    def _all(self, body: Sequence[ast.stmt]) -> None:
        for node in body:
            method = getattr(self, f"_{type(node).__name__.lower()}", None)
            if method is None:
                raise self.refuse(node, f"{type(node).__name__}: {_first_line(node)}")
            method(node)

    def _block(self, body: Sequence[ast.stmt]) -> None:
        self._depth += 1
        self._all(body)
        self._depth -= 1

    # ------------------------------------------------------------------ statements

    def _expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Call):
            raise self.refuse(node, ast.unparse(node))
        found = self.call(node.value)
        self._line(f"{found if isinstance(found, str) else found.text};")

    def _continue(self, node: ast.Continue) -> None:
        self._line("continue;")

    def _return(self, node: ast.Return) -> None:
        if node.value is None:
            raise self.refuse(node, "a return without a value")
        value = self.number(node.value)
        self.returns = REAL if REAL in (self.returns, value.kind) else INT
        self._line(f"return {self.language.coerce(value, self.returns).text};")

    def _pass(self, node: ast.Pass) -> None:
        pass

    def _if(self, node: ast.If, word: str = "if") -> None:
        test = self.truth(node.test)
        if test.known is not None:
            # Only what can ever happen is printed.
            chosen = node.body if test.known else node.orelse
            if word == "if":
                self._all(chosen)
                return
            self._line("} else {")
            self._block(chosen)
        else:
            self._line(f"{word} ({test.text}) {{")
            self._block(node.body)
            if len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If):
                self._if(node.orelse[0], "} else if")
                return
            if node.orelse:
                self._line("} else {")
                self._block(node.orelse)
        self._line("}")

    def _while(self, node: ast.While) -> None:
        if node.orelse:
            raise self.refuse(node, "while with else")
        self._line(f"while ({self.truth(node.test).text}) {{")
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
            what = f"expected for NAME in range(...), got {_first_line(node)}"
            raise self.refuse(node, what)
        start, end = [self.whole(part) for part in [ast.Constant(0), *made.args][-2:]]
        if end.known is None and self.source.stored[ast.unparse(made.args[-1])] != 1:
            # Python asks only once where it ends.
            end = self._keep(end)
        if start.known is not None and end.known is not None and start.known >= end.known:
            return
        name = self.language.name(target.id)
        # Its name is its own: the same may stand for something else elsewhere.
        kept = self.kinds.get(target.id)
        self.kinds[target.id] = INT
        declared = self.language.declare(name, INT)
        self._line(f"for ({declared} = {start.text}; {name} < {end.within(SUM)}; ++{name}) {{")
        self._block(node.body)
        self._line("}")
        del self.kinds[target.id]
        if kept is not None:
            self.kinds[target.id] = kept

    # ------------------------------------------------------------------ assignments

    def _assign(self, node: ast.Assign) -> None:
        target = node.targets[0]
        if len(node.targets) > 1:
            shared = self._keep(self.value(node.value))
            for place in node.targets:
                self._store(node, place, shared)
        elif isinstance(target, ast.Tuple):
            if not isinstance(node.value, ast.Tuple) or len(node.value.elts) != len(target.elts):
                what = f"expected as many values as names: {ast.unparse(node)}"
                raise self.refuse(node, what)
            pairs = list(zip(target.elts, node.value.elts, strict=True))
            if any(_meet(place, value) for place, _ in pairs for _, value in pairs[1:]):
                # All values are there before the first name gets one.
                kept = [self._keep(self.value(value)) for _, value in pairs]
                for (place, _), known in zip(pairs, kept, strict=True):
                    self._store(node, place, known)
            else:
                for place, given in pairs:
                    self._store(node, place, self.value(given))
        else:
            self._store(node, target, self.value(node.value))

    def _keep(self, value: Value) -> Value:
        """Give a value that is no constant a name."""
        if value.known is not None:
            return value
        self._temporaries += 1
        name = f"kept_{self._temporaries}"
        self._line(f"{self.language.declare(name, value.kind)} = {value.text};")
        return Value(name, value.kind)

    def _store(self, node: ast.Assign, target: ast.expr, value: Value) -> None:
        if isinstance(target, ast.Name):
            self._store_name(node, target, value)
            return
        if not isinstance(target, (ast.Attribute, ast.Subscript)):
            raise self.refuse(target, ast.unparse(target))
        place = self.value(target)
        if not isinstance(place.kind, Number) or not isinstance(value.kind, Number):
            raise self.refuse(target, f"an assignment to {place.kind}: {ast.unparse(target)}")
        if value.kind == REAL and place.kind == INT:
            raise self.refuse(target, f"a real number in an integer: {ast.unparse(target)}")
        self._line(f"{place.text} = {self.language.coerce(value, place.kind).text};")

    def _store_name(self, node: ast.Assign, target: ast.Name, value: Value) -> None:
        name, kind = target.id, self.kinds.get(target.id, value.kind)
        if isinstance(value.kind, Number) and isinstance(kind, Number):
            kind = REAL if REAL in (kind, value.kind) else INT
        elif kind != value.kind:
            raise self.refuse(target, f"{name} is first {kind}, then {value.kind}")
        if self._given.get(name, kind) != kind:
            raise self.refuse(target, f"{name} is given as {self._given[name]}, then {kind}")
        if value.known is not None and kind == INT and self.source.stored[name] == 1:
            self.fixed[name] = value
            return
        self.kinds[name] = kind
        left = self.language.name(name)
        if self.source.declared.get(name) is node:
            left = self.language.declare(left, kind)
        if isinstance(kind, Number):
            value = self.language.coerce(value, kind)
        self._line(f"{left} = {value.text};")

    def _augassign(self, node: ast.AugAssign) -> None:
        if type(node.op) not in _AUGMENTED:
            raise self.refuse(node, ast.unparse(node))
        target, value = self.number(node.target), self.number(node.value)
        if target.kind == INT and (value.kind == REAL or isinstance(node.op, ast.Div)):
            if not isinstance(node.target, ast.Name) or node.target.id in self._given:
                raise self.refuse(node, f"a real number in an integer: {ast.unparse(node)}")
            # It is real from the start, then.
            self.kinds[node.target.id] = REAL
            target = target._replace(kind=REAL)
        assert isinstance(target.kind, Number)
        right = self.language.coerce(value, target.kind)
        self._line(f"{target.text} {_AUGMENTED[type(node.op)]} {right.text};")


def _count(name: str, lines: Sequence[str]) -> int:
    """Return how often a variable occurs in some lines; a field may have the same name."""
    return sum(len(re.findall(rf"(?<!->)(?<!\.)\b{name}\b", line)) for line in lines)


def _without_unused(lines: list[str], names: Sequence[str]) -> list[str]:
    """Return lines without those that give a value to variables which nothing looks at.

    Constants decide what would have. A call is made all the same: it may write.
    """
    for name in names:
        stores = [x for x in lines if re.fullmatch(rf" *([\w ]+[ *])?{name} = ((?!\w\().)*;", x)]
        if stores and _count(name, lines) == len(stores):
            rest = [line for line in lines if line not in stores]
            return _without_unused(rest, names)
    return lines


def _meet(place: ast.expr, value: ast.expr) -> bool:
    """Return whether a value may depend on what an assignment to a place changes."""
    names = [
        {part.attr if isinstance(part, ast.Attribute) else part.id
         for part in ast.walk(node) if isinstance(part, (ast.Name, ast.Attribute))}
        for node in (place, value)
    ]  # fmt: skip
    return bool(names[0] & names[1]) or any(isinstance(x, ast.Call) for x in ast.walk(value))


def _first_line(node: ast.AST) -> str:
    return ast.unparse(node).partition("\n")[0]
