"""How many operations a tick takes: counted while the kernels run, line by line, as Python."""

from __future__ import annotations

import ast
import copy
from collections.abc import Callable
from typing import Any, cast

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.export.parts import Law
from fpid_pin.export.source import Source, is_kernel


class Count:
    """Runs kernels and counts additions, subtractions, products, quotients and calls of `math`."""

    def __init__(self) -> None:
        self.total = 0
        self._made: dict[Any, Callable[..., Any]] = {}

    def __call__(self, value: Any) -> Any:
        """Count an operation whose result is `value`, unless that is an integer."""
        self.total += isinstance(value, float)
        return value

    def version_of(self, kernel: Any) -> Callable[..., Any]:
        """Return a kernel in Python that counts, and whose kernels count."""
        source = Source(kernel)
        if source.function not in self._made:
            tree = _Counting().visit(copy.deepcopy(source.tree))
            tree.decorator_list = []
            module = ast.fix_missing_locations(ast.Module([tree], []))
            names = dict(source.globals)
            self._made[source.function] = lambda *a: names[source.name](*a)
            for name in {n.id for n in ast.walk(tree) if isinstance(n, ast.Name)}:
                known = source.globals.get(name)
                if known is not None and is_kernel(known):
                    names[name] = self.version_of(known)
            names["_count"] = self
            exec(compile(module, source.file, "exec"), names)
        return self._made[source.function]


class _Counting(ast.NodeTransformer):
    """Puts ``_count(...)`` around what is an operation if its result is a real number."""

    def visit_BinOp(self, node: ast.BinOp) -> ast.AST:
        return self._counted(self.generic_visit(node))

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST:
        self.generic_visit(node)
        target = copy.deepcopy(node.target)
        for part in ast.walk(target):
            if isinstance(part, (ast.Name, ast.Attribute, ast.Subscript)) and part is target:
                part.ctx = ast.Load()
        value = self._counted(ast.BinOp(target, node.op, node.value))
        return ast.Assign([node.target], value)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        self.generic_visit(node)
        return self._counted(node) if ast.unparse(node.func).startswith("math.") else node

    @staticmethod
    def _counted(node: ast.AST) -> ast.expr:
        return ast.Call(ast.Name("_count", ast.Load()), [cast("ast.expr", node)], [])


def operations(law: Law, inputs: FloatArray) -> int:
    """Return the most operations that a tick of the law takes over `inputs`, (ticks, 5, n)."""
    count = Count()
    calls = [(count.version_of(call.kernel), call.arguments) for call in law.calls]
    memory, most = law.memory(), 0
    with np.errstate(all="ignore"):
        for row in inputs:
            memory["inputs"][:, 0] = row
            before = count.total
            for function, names in calls:
                function(*[memory[a] if isinstance(a, str) else a for a in names])
            most = max(most, count.total - before)
    return most
