"""Prints the kernels that simulate, as they stand, as C99 or JavaScript.

A kernel is printed for the kinds of its arguments, and so are those that it calls, each once for
each combination of kinds: `Program` collects them, callees first. What is outside the kernels'
subset is refused with file and line.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from fpid_pin.export.c99 import C99
from fpid_pin.export.expressions import Printed
from fpid_pin.export.kinds import Kind, Number
from fpid_pin.export.source import Source
from fpid_pin.export.statements import Statements

#: What is called in a kernel's place, from the arguments of its call.
StandIn = Callable[[Sequence[ast.expr]], tuple[Any, Sequence[ast.expr]]]


class Program:
    """Kernels in another language.

    `stand_ins` are for kernels that are not printed themselves: from the arguments of a call, what
    is called in their place, and with what. They may change from one `add` to the next.
    """

    def __init__(self, language: C99, stand_ins: Mapping[Any, StandIn] | None = None) -> None:
        self.language = language
        self.stand_ins = stand_ins or {}
        self._printed: dict[tuple[Any, ...], Printed] = {}
        #: Those that are there, callees first; the names of those asked for from outside.
        self._done: list[Printed] = []
        self._asked: list[str] = []

    @property
    def text(self) -> str:
        """All functions that were asked for, and those that they call, callees first."""
        found = ""
        for printed in reversed(self._done):
            if printed.name in self._asked or re.search(rf"\b{printed.name}\(", found):
                found = f"{printed.text}\n{found}" if found else printed.text
        return found

    def instead(self, kernel: Any, arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        """Return what is called in a kernel's place, and with what; itself as a rule."""
        stand_in = self.stand_ins.get(kernel) if callable(kernel) else None
        return (kernel, arguments) if stand_in is None else stand_in(arguments)

    def add(
        self, kernel: Any, kinds: Sequence[Kind], node: ast.AST | None = None,
        caller: Source | None = None,
    ) -> Printed:  # fmt: skip
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
        if key not in self._printed:
            self._printed[key] = Printed(self._name(source))
            self._translate(source, kinds, self._printed[key])
        elif not self._printed[key].text:
            raise origin.refusal(node, f"recursion: {source.name} calls itself")
        if caller is None:
            self._asked.append(self._printed[key].name)
        return self._printed[key]

    def _translate(self, source: Source, kinds: Sequence[Kind], printed: Printed) -> None:
        language = self.language
        body = Statements(source, language, self, kinds)
        printed.returns = body.returns
        given = list(zip(source.parameters, kinds, strict=True))
        printed.taken = [isinstance(kind, Number) or body.uses(name) for name, kind in given]
        taken = [x for x, used in zip(given, printed.taken, strict=True) if used]
        unused = [language.name(name) for name, _ in taken if not body.uses(name)]
        lines = [
            f"/* {source.module}.{source.name}: {source.says.replace('*/', '* /')} */",
            *language.head(
                printed.name, [(language.name(n), kind) for n, kind in taken], body.returns
            ),
            *(line for name in unused for line in language.unused(name)),
            *body.lines, "}", "",
        ]  # fmt: skip
        printed.text = "\n".join(lines)
        self._done.append(printed)

    def _name(self, source: Source) -> str:
        """Return a name that no other function has, nor the language."""
        taken = {printed.name for printed in self._printed.values()}
        taken |= self.language.reserved | self.language.taken
        name, count = source.name, 1
        while name in taken:
            name = f"{source.module}_{source.name}" + f"_{count}" * (count > 1)
            count += 1
        return name
