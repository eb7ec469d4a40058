"""Where the variables of a kernel live.

Python's variables are the function's; those of C and JavaScript are a block's. A variable is
declared where it gets a value, in each block that gives it one before it is looked at, else at the
top.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator

from fpid_pin.export.source import Source

_Path = tuple[int, ...]


class Scopes:
    """What a kernel's names are used for.

    Attributes
    ----------
    hoisted
        Names to declare at the top of the function.
    steady
        Names that keep their value: they get one in one line only, or with the call.
    """

    def __init__(self, source: Source) -> None:
        self._parameters = set(source.parameters)
        #: For each name, the block of every occurrence, and whether a value is given to it there.
        self._seen: dict[str, list[tuple[_Path, bool]]] = {}
        self._blocks = 0
        self._walk(source.body, (), frozenset())
        self.hoisted = [name for name, where in self._seen.items() if self._outlives(where)]
        stores = [
            node.id
            for node in ast.walk(source.tree)
            if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)
        ]
        self.steady = {
            name
            for name in self._parameters.union(stores)
            if stores.count(name) + (name in self._parameters) == 1
        }

    @staticmethod
    def _outlives(where: list[tuple[_Path, bool]]) -> bool:
        """Return whether a value may have been given in a block that is over."""
        given: list[_Path] = []
        for path, stored in where:
            if stored:
                given.append(path)
            elif not any(path[: len(block)] == block for block in given):
                # A name without any value is not a variable.
                return any(is_stored for _, is_stored in where)
        return False

    def _walk(self, body: list[ast.stmt], path: _Path, loops: frozenset[str]) -> None:
        for node in body:
            for child, inner, bound in self._parts(node, path, loops):
                if isinstance(child, list):
                    self._walk(child, inner, bound)
                else:
                    self._note(child, inner, bound)

    def _parts(
        self, node: ast.stmt, path: _Path, loops: frozenset[str]
    ) -> Iterator[tuple[ast.AST | list[ast.stmt], _Path, frozenset[str]]]:
        """Yield the expressions of a statement, and its blocks."""
        if isinstance(node, (ast.If, ast.While)):
            yield node.test, path, loops
            for block in (node.body, node.orelse):
                self._blocks += 1
                yield block, (*path, self._blocks), loops
        elif isinstance(node, ast.For):
            yield node.iter, path, loops
            bound = loops | {node.target.id} if isinstance(node.target, ast.Name) else loops
            self._blocks += 1
            yield node.body, (*path, self._blocks), bound
        elif isinstance(node, ast.Assign):
            # The value is there before the name.
            yield node.value, path, loops
            for target in node.targets:
                yield target, path, loops
        else:
            yield node, path, loops

    def _note(self, node: ast.AST, path: _Path, loops: frozenset[str]) -> None:
        for name in ast.walk(node):
            if isinstance(name, ast.Name) and name.id not in loops | self._parameters:
                stored = isinstance(name.ctx, ast.Store) and not isinstance(node, ast.AugAssign)
                self._seen.setdefault(name.id, []).append((path, stored))

    @staticmethod
    def touches(target: ast.expr, value: ast.expr) -> bool:
        """Return whether `value` may read what an assignment to `target` changes."""
        nodes = list(ast.walk(value))
        if isinstance(target, ast.Name):
            return any(isinstance(n, ast.Name) and n.id == target.id for n in nodes)
        if any(isinstance(n, ast.Call) and "math." not in ast.unparse(n) for n in nodes):
            return True
        if isinstance(target, ast.Attribute):
            return any(isinstance(n, ast.Attribute) and n.attr == target.attr for n in nodes)
        return any(isinstance(n, ast.Subscript) for n in nodes)
