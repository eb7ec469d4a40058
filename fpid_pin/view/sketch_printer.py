"""A stand-in for `fpid_pin.export.printer`: kernels as JavaScript over one flat memory M."""

from __future__ import annotations

import ast
import inspect
import math
import textwrap
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Kind:
    """A number (no shape, no fields), a record, or an array of either."""

    shape: tuple[int, ...] | None = None
    fields: tuple[str, ...] | None = None

    @property
    def size(self) -> int:
        """Words of one element."""
        return len(self.fields) if self.fields else 1


NUMBER = Kind()
_OPS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Mod: "%",
    ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=", ast.Eq: "===", ast.NotEq: "!==",
    ast.And: "&&", ast.Or: "||", ast.USub: "-", ast.Not: "!",
}  # fmt: skip
_CALLS = {
    "min": "Math.min", "max": "Math.max", "abs": "Math.abs", "int": "Math.trunc",
    "isfinite": "Number.isFinite",
}  # fmt: skip


class Module:
    """The functions printed so far, each once for every set of kinds that it is called with."""

    def __init__(self) -> None:
        self.texts: dict[str, str] = {}
        self._names: dict[tuple[str, tuple[Kind, ...]], tuple[str, Kind | None]] = {}

    def add(self, kernel: Any, kinds: tuple[Kind, ...]) -> str:
        """Print a kernel and all that it calls; return its name."""
        function = getattr(kernel, "py_func", kernel)
        key = (f"{function.__module__}.{function.__name__}", kinds)
        if key not in self._names:
            name, count = function.__name__, 2
            while name in self.texts:
                name, count = f"{function.__name__}_{count}", count + 1
            self.texts[name] = ""
            self._names[key] = (name, None)
            self.texts[name] = _Printer(self, function, name, kinds).text
        return self._names[key][0]

    @property
    def text(self) -> str:
        """All functions."""
        return "\n".join(self.texts.values())


class _Printer:
    def __init__(self, module: Module, function: Any, name: str, kinds: tuple[Kind, ...]) -> None:
        tree = ast.parse(textwrap.dedent(inspect.getsource(function))).body[0]
        assert isinstance(tree, ast.FunctionDef)
        self.module, self.globals = module, function.__globals__
        arguments = [a.arg for a in tree.args.args]
        assert len(arguments) == len(kinds), name
        self.kinds = dict(zip(arguments, kinds, strict=True))
        self.out: list[str] = []
        self.locals: list[str] = []
        self.temps = 0
        for statement in tree.body[1:] if ast.get_docstring(tree) else tree.body:
            self.statement(statement, "  ")
        head = f"  let {', '.join(self.locals)};\n" if self.locals else ""
        body = "\n".join(self.out)
        self.text = f"function {name}({', '.join(arguments)}) {{\n{head}{body}\n}}\n"

    def line(self, indent: str, text: str) -> None:
        self.out.append(indent + text)

    def block(self, body: list[ast.stmt], indent: str) -> None:
        for statement in body:
            self.statement(statement, indent + "  ")

    def statement(self, s: ast.stmt, indent: str) -> None:
        match s:
            case ast.Assign(targets=targets, value=value):
                self.assign(targets, value, indent)
            case ast.AugAssign(target=target, op=op, value=value):
                left, right = self.number(target), self.number(value)
                self.line(indent, f"{left} {_OPS[type(op)]}= {right};")
            case ast.Expr(value=value):
                self.line(indent, self.expression(value)[1] + ";")
            case ast.Return(value=value):
                self.line(indent, f"return {self.number(value)};" if value else "return;")
            case ast.Continue():
                self.line(indent, "continue;")
            case ast.If(test=test, body=body, orelse=other):
                self.line(indent, f"if ({self.number(test)}) {{")
                self.block(body, indent)
                if other:
                    self.line(indent, "} else {")
                    self.block(other, indent)
                self.line(indent, "}")
            case ast.While(test=test, body=body):
                self.line(indent, f"while ({self.number(test)}) {{")
                self.block(body, indent)
                self.line(indent, "}")
            case ast.For(target=ast.Name(id=i), iter=ast.Call(args=args), body=body):
                self.declare(i, NUMBER)
                bounds = [self.number(a) for a in args]
                low, high = bounds if len(bounds) == 2 else ["0", *bounds]
                self.line(indent, f"for ({i} = {low}; {i} < {high}; {i}++) {{")
                self.block(body, indent)
                self.line(indent, "}")
            case _:
                raise NotImplementedError(ast.unparse(s))

    def declare(self, name: str, kind: Kind) -> None:
        if name not in self.kinds:
            self.locals.append(name)
        self.kinds[name] = kind

    def assign(self, targets: list[ast.expr], value: ast.expr, indent: str) -> None:
        if isinstance(targets[0], ast.Tuple):
            assert isinstance(value, ast.Tuple)
            found = [self.expression(v) for v in value.elts]
            temps = [f"$t{self.temps + k}" for k in range(len(found))]
            self.temps += len(found)
            for temp, (_, text) in zip(temps, found, strict=True):
                self.line(indent, f"const {temp} = {text};")
            for target, temp, (kind, _) in zip(targets[0].elts, temps, found, strict=True):
                self.store(target, kind, temp, indent)
            return
        kind, text = self.expression(value)
        for target in targets:
            self.store(target, kind, text, indent)

    def store(self, target: ast.expr, kind: Kind, text: str, indent: str) -> None:
        if isinstance(target, ast.Name):
            self.declare(target.id, kind)
            self.line(indent, f"{target.id} = {text};")
        else:
            self.line(indent, f"{self.number(target)} = {text};")

    def number(self, e: ast.expr | None) -> str:
        assert e is not None
        kind, text = self.expression(e)
        assert kind == NUMBER, ast.unparse(e)
        return text

    def expression(self, e: ast.expr) -> tuple[Kind, str]:
        match e:
            case ast.Constant(value=bool(value)):
                return NUMBER, "true" if value else "false"
            case ast.Constant(value=value):
                return NUMBER, repr(value)
            case ast.Name(id=name) if name in self.kinds:
                return self.kinds[name], name
            case ast.Name(id=name):
                return NUMBER, repr(self.globals[name])
            case ast.BinOp(left=left, op=ast.FloorDiv(), right=right):
                return NUMBER, f"Math.floor({self.number(left)} / {self.number(right)})"
            case ast.BinOp(left=left, op=op, right=right):
                return NUMBER, f"({self.number(left)} {_OPS[type(op)]} {self.number(right)})"
            case ast.UnaryOp(op=op, operand=operand):
                return NUMBER, f"{_OPS[type(op)]}({self.number(operand)})"
            case ast.BoolOp(op=op, values=values):
                return NUMBER, f"({f' {_OPS[type(op)]} '.join(self.number(v) for v in values)})"
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return NUMBER, f"({self.number(left)} {_OPS[type(op)]} {self.number(right)})"
            case ast.IfExp(test=test, body=body, orelse=other):
                one, two = self.number(body), self.number(other)
                return NUMBER, f"({self.number(test)} ? {one} : {two})"
            case ast.Subscript(value=ast.Attribute(value=array, attr="shape"), slice=k):
                kind, _ = self.expression(array)
                assert isinstance(k, ast.Constant)
                assert kind.shape is not None
                return NUMBER, str(kind.shape[k.value])
            case ast.Subscript(value=value, slice=index):
                return self.element(value, index)
            case ast.Attribute(value=value, attr="size"):
                kind, _ = self.expression(value)
                assert kind.shape is not None
                return NUMBER, str(math.prod(kind.shape))
            case ast.Attribute(value=value, attr=field):
                kind, text = self.expression(value)
                assert kind.fields is not None
                return NUMBER, f"M[{text} + {kind.fields.index(field)}]"
            case ast.Call(func=ast.Attribute(value=ast.Name(id="math"), attr=name), args=args):
                return NUMBER, f"{_CALLS.get(name, f'Math.{name}')}({', '.join(map(self.number, args))})"
            case ast.Call(func=ast.Name(id=name), args=args):
                found = [self.expression(a) for a in args]
                texts = ", ".join(text for _, text in found)
                if name in _CALLS:
                    return NUMBER, f"{_CALLS[name]}({texts})"
                called = self.module.add(self.globals[name], tuple(kind for kind, _ in found))
                return NUMBER, f"{called}({texts})"
        raise NotImplementedError(ast.unparse(e))

    def element(self, value: ast.expr, index: ast.expr) -> tuple[Kind, str]:
        kind, base = self.expression(value)
        assert kind.shape is not None, ast.unparse(value)
        parts = index.elts if isinstance(index, ast.Tuple) else [index]
        terms, count = [base], len(parts)
        rest = kind.shape[count:]
        slices = [p for p in parts if isinstance(p, ast.Slice)]
        if slices:
            assert count == 1
            low = self.number(slices[0].lower)
            high = self.number(slices[0].upper) if slices[0].upper else str(kind.shape[0])
            words = kind.size * math.prod(rest)
            return Kind((f"(({high}) - ({low}))", *rest), kind.fields), f"({base} + {words} * ({low}))"  # type: ignore[arg-type]
        for k, part in enumerate(parts):
            words = kind.size * math.prod(kind.shape[k + 1 :])
            text = self.number(part)
            if text != "0":
                terms.append(f"{words} * {text}" if words != 1 else text)
        place = "(" + " + ".join(terms) + ")" if len(terms) > 1 else terms[0]
        if rest:
            return Kind(rest, kind.fields), place
        return (Kind(None, kind.fields), place) if kind.fields else (NUMBER, f"M[{place}]")
