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

from fpid_pin.export.kinds import Bundle, Kind
from fpid_pin.export.language import Language, Parameter
from fpid_pin.export.source import Source
from fpid_pin.export.statements import Statements

#: What is called in a kernel's place, from the arguments of its call.
StandIn = Callable[[Sequence[ast.expr]], tuple[Any, Sequence[ast.expr]]]


@dataclass
class _Printed:
    """A kernel printed for some kinds of arguments."""

    name: str
    source: Source
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
    members
        Arrays of bundles that they use: names of bundle and array.
    """

    def __init__(self, language: Language, stand_ins: Mapping[Any, StandIn] | None = None) -> None:
        self.language = language
        self.functions: list[str] = []
        self.members: set[tuple[str, str]] = set()
        self._stand_ins = stand_ins or {}
        self._printed: dict[tuple[Any, ...], _Printed] = {}

    @property
    def text(self) -> str:
        """All functions."""
        return "\n".join(self.functions)

    def add(self, kernel: Any, kinds: Sequence[Kind]) -> str:
        """Print a kernel and all that it calls; return the name of its function.

        Parameters
        ----------
        kernel
            See `kernels.compiled.kernel`.
        kinds
            Of its arguments.

        Raises
        ------
        ExportError
            A line that has no counterpart.
        """
        source = Source(kernel)
        if len(kinds) != len(source.parameters):
            what = f"{len(source.parameters)} arguments, given {len(kinds)}"
            raise source.refusal(source.tree, what)
        return self._print(source, tuple(kinds), source.tree, source).name

    def note(self, bundle: Bundle, member: str) -> None:
        """See `expressions.Caller`."""
        self.members.add((bundle.name, member))

    def instead(self, kernel: Any, arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        """See `expressions.Caller`."""
        stand_in = self._stand_ins.get(kernel) if callable(kernel) else None
        return (kernel, arguments) if stand_in is None else stand_in(arguments)

    def call(
        self, kernel: Any, kinds: Sequence[Kind], node: ast.AST, caller: Source
    ) -> tuple[str, Kind | None, list[bool]]:
        """See `expressions.Caller`."""
        source = Source(kernel)
        if len(kinds) != len(source.parameters):
            raise caller.refusal(node, f"{source.name} takes {len(source.parameters)} arguments")
        printed = self._print(source, tuple(kinds), node, caller)
        return printed.name, printed.returns, [p.written for p in printed.parameters]

    def _print(
        self, source: Source, kinds: tuple[Kind, ...], node: ast.AST, caller: Source
    ) -> _Printed:
        # The same function may have been compiled more than once.
        key = (source.file, source.name, source.function.__code__, kinds)
        if key in self._printed:
            if not self._printed[key].done:
                raise caller.refusal(node, f"recursion: {source.name} calls itself")
            return self._printed[key]
        printed = self._printed[key] = _Printed(self._name(source), source)
        body = Statements(source, self.language, self, kinds)
        printed.parameters, printed.returns = body.parameters, body.returns
        head = self.language.head(printed.name, body.parameters, body.returns)
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
