"""A kernel's own text, and where it stands."""

from __future__ import annotations

import ast
import inspect
import textwrap
from collections.abc import Mapping
from pathlib import Path
from types import FunctionType
from typing import Any

from fpid_pin.exceptions import ExportError

_PACKAGE = Path(__file__).parents[2]


def is_kernel(thing: Any) -> bool:
    """Return whether `thing` is a kernel: compiled by numba, or a function where nothing is."""
    return isinstance(getattr(thing, "py_func", thing), FunctionType)


class Source:
    """The syntax tree of a kernel.

    Parameters
    ----------
    kernel
        See `kernels.compiled.kernel`.

    Raises
    ------
    ExportError
        No Python source: it was typed in, or is no kernel at all.
    """

    def __init__(self, kernel: Any) -> None:
        function = getattr(kernel, "py_func", kernel)
        name = getattr(function, "__name__", repr(kernel))
        if not isinstance(function, FunctionType):
            raise ExportError(f"{name}: expected a kernel, got {type(kernel).__name__}")
        try:
            lines, first = inspect.getsourcelines(function)
        except (OSError, TypeError):
            raise ExportError(f"{name}: expected a kernel in a file, got one without") from None
        tree = ast.parse(textwrap.dedent("".join(lines))).body[0]
        if not isinstance(tree, ast.FunctionDef):
            raise ExportError(f"{name}: expected a kernel made by def, got {ast.unparse(tree)}")
        self.function, self.tree, self.name = function, tree, name
        cells = [cell.cell_contents for cell in function.__closure__ or ()]
        closed = dict(zip(function.__code__.co_freevars, cells, strict=True))
        self.globals: Mapping[str, Any] = {**function.__globals__, **closed}
        self._first = first
        path = Path(function.__code__.co_filename)
        self.file = str(path.relative_to(_PACKAGE)) if path.is_relative_to(_PACKAGE) else str(path)

    @property
    def module(self) -> str:
        """The last part of the module's name."""
        return self.function.__module__.rpartition(".")[2]

    @property
    def says(self) -> str:
        """The first line of the docstring."""
        return (ast.get_docstring(self.tree) or "").partition("\n")[0]

    @property
    def body(self) -> list[ast.stmt]:
        """The statements, without the docstring."""
        return self.tree.body[ast.get_docstring(self.tree) is not None :]

    @property
    def parameters(self) -> list[str]:
        """The names of the arguments."""
        given = self.tree.args
        if given.vararg or given.kwarg or given.kwonlyargs or given.posonlyargs or given.defaults:
            raise self.refusal(self.tree, "arguments other than plain ones")
        return [argument.arg for argument in given.args]

    def refusal(self, node: ast.AST, what: str) -> ExportError:
        """Return the error that says where something stands that cannot be printed."""
        line = self._first + getattr(node, "lineno", 1) - 1
        return ExportError(f"{self.file}:{line}: {self.name}: cannot be printed: {what}")
