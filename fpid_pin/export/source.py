"""A kernel's own text, and where it stands."""

import ast
import inspect
import textwrap
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from types import FunctionType
from typing import Any

from fpid_pin.exceptions import ExportError

_PACKAGE = Path(__file__).parents[2]


class Source:
    """The syntax tree of a kernel (`kernels.compiled.kernel`), and where its variables live.

    Python's variables are the function's, those of C and JavaScript a block's. `declared` has the
    assignment that declares a variable, where one comes before all other uses of it in the
    innermost block that has them all; `hoisted` has the others, declared at the function's top.
    """

    def __init__(self, kernel: Any) -> None:
        function = getattr(kernel, "py_func", kernel)
        name = getattr(function, "__name__", repr(kernel))
        if not isinstance(function, FunctionType):
            raise ExportError(f"{name}: expected a kernel, got {type(kernel).__name__}")
        try:
            lines, self._first = inspect.getsourcelines(function)
        except (OSError, TypeError):
            raise ExportError(f"{name}: expected a kernel in a file, got one without") from None
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise ExportError(f"{name}: expected a kernel made by def, got {ast.unparse(tree)}")
        self.function, self.tree, self.name = function, tree, name
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        closed = dict(zip(function.__code__.co_freevars, cells, strict=True))
        self.globals: Mapping[str, Any] = {**function.__globals__, **closed}
        self.inner = tuple(map(id, cells))
        path = Path(function.__code__.co_filename)
        self.file = str(path.relative_to(_PACKAGE)) if path.is_relative_to(_PACKAGE) else str(path)
        self.module = function.__module__.rpartition(".")[2]
        says = ast.get_docstring(tree) or ""
        self.says = says.partition("\n")[0]
        self.body = tree.body[bool(says) :]
        given = tree.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs or given.defaults:
            raise self.refusal(tree, "arguments other than plain ones")
        self.parameters = [argument.arg for argument in given.args]
        self._uses = Counter(_names(self.body))
        self.stored = Counter(self.parameters) + Counter(_names(self.body, ast.Store))
        loops = Counter(ast.unparse(x.target) for x in ast.walk(tree) if isinstance(x, ast.For))
        others = {*self.parameters, *(x for x in loops if loops[x] == self.stored[x])}
        self.declared: dict[str, ast.stmt] = {}
        self._declare(self.body, others)
        self.hoisted = [name for name in self.stored if name not in others | self.declared.keys()]

    def _declare(self, body: Sequence[ast.stmt], others: set[str]) -> None:
        """Find the declarations within some statements, those of inner blocks first."""
        for statement in body:
            for block in ("body", "orelse"):
                self._declare(getattr(statement, block, ()), others)
        here = Counter(_names(body))
        for name in set(_names(body, ast.Store)) - others - self.declared.keys():
            first = next(s for s in body if name in _names([s]))
            plain = isinstance(first, ast.Assign) and name not in _names([first.value])
            if plain and here[name] == self._uses[name]:
                self.declared[name] = first

    def refusal(self, node: ast.AST, what: str) -> ExportError:
        """Return the error that says where something stands that cannot be printed."""
        line = self._first + getattr(node, "lineno", 1) - 1
        return ExportError(f"{self.file}:{line}: {self.name}: cannot be printed: {what}")


def _names(nodes: Sequence[ast.AST], context: type = ast.expr_context) -> Iterator[str]:
    """Yield the name of each variable in some syntax trees, as often as it occurs."""
    for node in nodes:
        for part in ast.walk(node):
            if isinstance(part, ast.Name) and isinstance(part.ctx, context):
                yield part.id
