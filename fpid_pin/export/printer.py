"""Prints the kernels that simulate, as they stand, as C99 or JavaScript.

A kernel is printed for the kinds of its arguments, and so are those that it calls, each once for
each combination of kinds: `Program` collects them, callees first. What is outside the kernels'
subset is refused with file and line.
"""

from __future__ import annotations

import ast
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from fpid_pin.export.kinds import Kind
from fpid_pin.export.language import Language, Parameter
from fpid_pin.export.source import Source
from fpid_pin.export.statements import Statements

#: What is called in a kernel's place, from the arguments of its call.
StandIn = Callable[[Sequence[ast.expr]], tuple[Any, Sequence[ast.expr]]]


@dataclass
class Printed:
    """A kernel printed for some kinds of arguments: what its callers want to know."""

    name: str
    returns: Kind | None = None
    parameters: list[Parameter] = field(default_factory=list)
    done: bool = False


class Program:
    """Kernels in another language.

    Parameters
    ----------
    language
        `c99.C99` or `javascript.JavaScript`.
    stand_ins
        For kernels that are not printed themselves: from the arguments of a call, what is called in
        their place, and with what.

    Attributes
    ----------
    functions
        The text of each function, callees first.
    """

    def __init__(self, language: Language, stand_ins: Mapping[Any, StandIn] | None = None) -> None:
        self.language = language
        self.functions: list[str] = []
        self._stand_ins = stand_ins or {}
        self._printed: dict[tuple[Any, ...], Printed] = {}

    @property
    def text(self) -> str:
        """All functions."""
        return "\n".join(self.functions)

    def instead(self, kernel: Any, arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        """Return what is called in a kernel's place, and with what; itself as a rule."""
        stand_in = self._stand_ins.get(kernel) if callable(kernel) else None
        return (kernel, arguments) if stand_in is None else stand_in(arguments)

    def add(
        self, kernel: Any, kinds: Sequence[Kind], node: ast.AST | None = None,
        caller: Source | None = None,
    ) -> Printed:  # fmt: skip
        """Print a kernel and all that it calls, unless they are there.

        Parameters
        ----------
        kernel
            See `kernels.compiled.kernel`.
        kinds
            Of its arguments.
        node, caller
            Where it is called, in another kernel's text; None: from outside.

        Raises
        ------
        ExportError
            A line that has no counterpart.
        """
        source = Source(kernel)
        node, caller = node or source.tree, caller or source
        if len(kinds) != len(source.parameters):
            what = f"{source.name} takes {len(source.parameters)} arguments, given {len(kinds)}"
            raise caller.refusal(node, what)
        # The same function may have been compiled more than once.
        key = (source.file, source.name, source.function.__code__, tuple(kinds))
        if key in self._printed:
            if not self._printed[key].done:
                raise caller.refusal(node, f"recursion: {source.name} calls itself")
            return self._printed[key]
        printed = self._printed[key] = Printed(self._name(source))
        body = Statements(source, self.language, self, kinds)
        printed.parameters, printed.returns = body.parameters, body.returns
        taken = [parameter for parameter in body.parameters if parameter.taken]
        head = self.language.head(printed.name, taken, body.returns)
        comment = f"/* {source.module}.{source.name}: {source.says.replace('*/', '* /')} */"
        self.functions.append("\n".join([comment, *head, *body.lines, "}", ""]))
        printed.done = True
        return printed

    def _name(self, source: Source) -> str:
        """Return a name that no other function has, nor the language."""
        taken = {printed.name for printed in self._printed.values()}
        taken |= self.language.reserved | self.language.taken
        if source.name not in taken:
            return source.name
        name = f"{source.module}_{source.name}"
        count = 2
        while name in taken:
            name, count = f"{source.module}_{source.name}_{count}", count + 1
        return name
