"""Prints the kernels that simulate, as they stand, as C99 or JavaScript.

A kernel is printed for the kinds of its arguments, and so are those that it calls, each once for
each combination of kinds: `Program` collects them, callees first. What is outside the kernels'
subset is refused with file and line.
"""

import ast
import re
from collections.abc import Callable, Sequence
from types import FunctionType
from typing import Any

from fpid_pin.export.c99 import C99
from fpid_pin.export.expressions import Expressions
from fpid_pin.export.kinds import INT, REAL, Kind, Number, Rank, Value
from fpid_pin.export.source import Source

_AUGMENTED = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}
_MATH = """
    sqrt exp expm1 log log1p pow sin cos tan asin acos atan atan2 sinh cosh tanh hypot floor ceil
    fabs copysign isfinite isnan
"""
#: The kinds of variables may depend on one another; more rounds than any kernel needs.
_ROUNDS = 8

#: From what is called and the arguments of its call: what is called in its place, and with what.
Instead = Callable[[Any, Sequence[ast.expr]], tuple[Any, Sequence[ast.expr]]]


class Program:
    """Kernels in another language; `instead` may change from one `add` to the next."""

    def __init__(self, language: C99, instead: Instead = lambda kernel, given: (kernel, given)):
        self.language, self.instead = language, instead
        self._functions: dict[tuple[Any, ...], Function] = {}
        #: Those that are whole, callees first; the names of those asked for from outside.
        self._done: list[Function] = []
        self._asked: list[str] = []

    @property
    def text(self) -> str:
        """All functions that were asked for, and those that they call, callees first."""
        found = ""
        for function in reversed(self._done):
            if function.name in self._asked or re.search(rf"\b{function.name}\(", found):
                found = f"{function.text}\n{found}" if found else function.text
        return found

    def add(
        self, kernel: Any, kinds: Sequence[Kind], node: ast.AST | None = None,
        caller: Source | None = None,
    ) -> "Function":  # fmt: skip
        """Print a kernel and all that it calls, unless they are there.

        `node` and `caller` are where it is called in another kernel's text. A line that has no
        counterpart raises `ExportError`.
        """
        source = Source(kernel)
        node, origin = node or source.tree, caller or source
        if len(kinds) != len(source.parameters):
            what = f"{source.name} takes {len(source.parameters)} arguments, given {len(kinds)}"
            raise origin.refusal(node, what)
        # The same function may have been compiled more than once; one that was made around another
        # is a function of its own.
        key = (source.function.__code__, source.name, source.inner, tuple(kinds))
        if key not in self._functions:
            function = Function(self, source, kinds, self._name(source))
            self._functions[key] = function
            function.translate()
            self._done.append(function)
        elif not self._functions[key].text:
            raise origin.refusal(node, f"recursion: {source.name} calls itself")
        if caller is None:
            self._asked.append(self._functions[key].name)
        return self._functions[key]

    def _name(self, source: Source) -> str:
        """Return a name that no other function has, nor the language."""
        taken = {function.name for function in self._functions.values()}
        taken |= self.language.reserved | self.language.taken
        name, count = source.name, 1
        while name in taken:
            name = f"{source.module}_{source.name}" + f"_{count}" * (count > 1)
            count += 1
        return name


class Function(Expressions):
    """One kernel, printed for the kinds of its arguments: name, text, and the kind of its value.

    `taken` says which arguments the printed function has: numbers may be calls, which are made in
    any case, and arrays that nothing is left of are none of its arguments.
    """

    def __init__(self, program: Program, source: Source, kinds: Sequence[Kind], name: str) -> None:
        super().__init__(source, program.language)
        self._program, self.name, self.text = program, name, ""
        self._given = dict(zip(source.parameters, kinds, strict=True))
        self.kinds.update(self._given)
        self.taken: list[bool] = []
        self.returns: Number | None = None

    def translate(self) -> None:
        """Print it."""
        # Kinds are known when nothing changes any more.
        for _ in range(_ROUNDS):
            before = (dict(self.kinds), self.returns)
            self._print()
            if before == (self.kinds, self.returns):
                break
        language, source = self.language, self.source
        names = [language.name(name) for name in self.kinds if name not in self._given]
        names += [f"kept_{k + 1}" for k in range(self._temporaries)]
        lines = _without_unused(self._lines, names)
        given = {language.name(name): kind for name, kind in self._given.items()}
        used = {name for name in given if _count(name, lines)}
        taken = {n: kind for n, kind in given.items() if n in used or isinstance(kind, Number)}
        self.taken = [name in taken for name in given]
        unused = [name for name in taken if name not in used]
        self.text = "\n".join([
            f"/* {source.module}.{source.name}: {source.says.replace('*/', '* /')} */",
            *language.head(self.name, taken, self.returns, unused), *lines, "}", "",
        ])  # fmt: skip

    def _print(self) -> None:
        self._lines: list[str] = []
        self._depth, self._temporaries = 1, 0
        for name in self.source.hoisted:
            if name in self.kinds:
                kind = self.kinds[name]
                declared = self.language.declare(self.language.name(name), kind)
                # The address 0 as well as the number.
                self._line(f"{declared} = 0;")
        self._all(self.source.body)

    def _line(self, text: str) -> None:
        self._lines.append("    " * self._depth + text)

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
        found = self._called(node.value)
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
        self._line(f"for ({declared} = {start.text}; {name} < {end.within(Rank.SUM)}; ++{name}) {{")
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

    # ------------------------------------------------------------------ calls

    def _call(self, node: ast.Call) -> Value:
        value = self._called(node)
        if not isinstance(value, Value):
            raise self.refuse(node, f"{ast.unparse(node.func)} returns nothing")
        return value

    def _called(self, node: ast.Call) -> Value | str:
        """Translate a call; a text is one of a kernel that returns nothing."""
        if node.keywords or any(isinstance(a, ast.Starred) for a in node.args):
            raise self.refuse(node, f"arguments other than plain ones: {ast.unparse(node)}")
        name = ast.unparse(node.func)
        if isinstance(node.func, ast.Attribute):
            if not name.startswith("math.") or node.func.attr not in _MATH.split():
                raise self.refuse(node, name)
            kind = INT if node.func.attr.startswith("is") else REAL
            return self.language.call(node.func.attr, [self.real(a) for a in node.args], kind)
        known = self.source.globals.get(name)
        if name in ("min", "max", "abs", "int") and known is None:
            return self._builtin(node, name)
        kernel, arguments = self._program.instead(known, node.args)
        if not isinstance(getattr(kernel, "py_func", kernel), FunctionType):
            raise self.refuse(node, f"{name}() is no kernel")
        values = [self.value(argument) for argument in arguments]
        found = self._program.add(kernel, [value.kind for value in values], node, self.source)
        taken = [v.text for v, used in zip(values, found.taken, strict=True) if used]
        text = f"{found.name}({', '.join(taken)})"
        return text if found.returns is None else Value(text, found.returns)

    def _builtin(self, node: ast.Call, name: str) -> Value:
        if len(node.args) != (2 if name in ("min", "max") else 1):
            raise self.refuse(node, f"{name} of {len(node.args)} numbers")
        given = self.alike(*node.args)
        if name == "int":
            return self.language.call("int", given, INT) if given[0].kind == REAL else given[0]
        if name == "abs":
            return self.language.call(name, [self.language.coerce(given[0], REAL)], REAL)
        kind = given[0].kind
        assert isinstance(kind, Number)
        return self.language.call(name, given, kind)


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
