"""The C files of a law: header, printed kernels, constants."""

from __future__ import annotations

import zlib
from collections.abc import Iterable
from typing import Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.export.c99 import C99, HELPERS
from fpid_pin.export.c_templates import HEADER, PARAMETERS, SOURCE
from fpid_pin.export.kinds import INT, REAL, Number, Record
from fpid_pin.export.language import product
from fpid_pin.export.parts import INPUTS, Law, Part
from fpid_pin.export.printer import Program

_LANGUAGE = C99()
_WIDTH = 100


class CSource:
    """The text of a law's C files.

    Parameters
    ----------
    law
        See `parts.law_of`.
    step
        Sampling period [s].

    Attributes
    ----------
    header, source, parameters
        Of ``fpid.h``, ``fpid.c`` and ``fpid_parameters.c``.
    """

    def __init__(self, law: Law, step: float) -> None:
        self._law, self._step = law, step
        program = Program(_LANGUAGE)
        self._tick = [
            f"    {program.add(call.kernel, [law.kind(a) for a in call.arguments])}"
            f"({', '.join(self._argument(a) for a in call.arguments)});"
            for call in law.calls
        ]
        # What is only given on is no argument's type.
        for part in law.parts:
            if isinstance(part.element, Record):
                program.records.setdefault(part.element.name, part.element)
        self._program = program
        self.parameters = self._parameters()
        self.stamp = zlib.crc32((self.parameters + program.text).encode()) & 0x7FFFFFFF
        #: Whether it has no sine or cosine in it, so that its bits are the same everywhere.
        self.exact = "real_sin(" not in program.text and "real_cos(" not in program.text
        self.header, self.source = self._header(), self._source()

    @property
    def records(self) -> Iterable[Record]:
        """The structs."""
        return self._program.records.values()

    def _argument(self, argument: str | float) -> str:
        if not isinstance(argument, str):
            return _LANGUAGE.number(argument).text
        name, _, row = argument.partition("[")
        if name == "inputs":
            place = product((int(row[:-1]), "FPID_JOINTS")).text if row else ""
            return f"&inputs[{place}]" if place and row != "0]" else "inputs"
        if name == "torque":
            return "output->torque"
        part = self._law.part(name)
        if part.fixed:
            return f"&fpid_{name}" if not part.shape else f"fpid_{name}"
        return f"state->{name}"

    # ------------------------------------------------------------------ files

    def _header(self) -> str:
        law = self._law
        extents = "\n".join(f"#define {name} {value}" for name, value in law.extents.items())
        moving = "\n".join(
            f"    {_type(part)} {part.name}{_extent(part)};" for part in law.parts if not part.fixed
        )
        constants = "\n".join(
            f"extern const {_type(part)} {_constant(part)}{_extent(part)};"
            for part in law.parts
            if part.values is not None
        )
        return HEADER.format(
            version=__version__, step=repr(float(self._step)), extents=extents, stamp=self.stamp,
            structs=_LANGUAGE.structs(self.records), moving=moving, constants=constants,
        )  # fmt: skip

    def _source(self) -> str:
        reset = [line for part in self._law.parts if not part.fixed for line in _reset(part)]
        return SOURCE.format(
            version=__version__, helpers=HELPERS, functions=self._program.text,
            reset="\n".join(reset), tick="\n".join(self._tick), inputs=INPUTS,
        )  # fmt: skip

    def _parameters(self) -> str:
        parts = [
            f"const {_type(part)} {_constant(part)}{_extent(part)} = {_values(part)};\n"
            for part in self._law.parts
            if part.values is not None
        ]
        return PARAMETERS.format(version=__version__, constants="\n".join(parts))


def _type(part: Part) -> str:
    return _LANGUAGE.type_of(part.element)


def _constant(part: Part) -> str:
    return f"fpid_{part.name}" if part.fixed else f"fpid_{part.name}_0"


def _extent(part: Part) -> str:
    return f"[{product(part.shape).text}]" if part.shape else ""


def _reset(part: Part) -> list[str]:
    """Return the lines that set a part of the state to what it is at t = 0."""
    loop = f"    for (int i = 0; i < {product(part.shape).text}; ++i) {{"
    if part.values is not None:
        return [loop, f"        state->{part.name}[i] = {_constant(part)}[i];", "    }"]
    if isinstance(part.element, Record):
        none = f"none_{part.element.name}"
        before = f"    static const {_type(part)} {none} = {{0}};"
        return [before, loop, f"        state->{part.name}[i] = {none};", "    }"]
    return [loop, f"        state->{part.name}[i] = {_LANGUAGE.real(0.0).text};", "    }"]


def _values(part: Part) -> str:
    """Return the initial values of a constant, an element a line."""
    flat = np.asarray(part.values).reshape(-1)
    if isinstance(part.element, Record):
        rows = [_row([_number(one[name], kind) for name, kind in part.element.fields])
                for one in flat]  # fmt: skip
    else:
        numbers = [_number(one, part.element) for one in flat]
        return "{\n" + _wrapped(numbers, "    ") + "\n}"
    return rows[0] if not part.shape else "{\n" + ",\n".join(rows) + "\n}"


def _row(numbers: list[str]) -> str:
    line = "{" + ", ".join(numbers) + "}"
    return f"    {line}" if len(line) < _WIDTH else "    {\n" + _wrapped(numbers, "        ") + "}"


def _wrapped(numbers: list[str], indent: str) -> str:
    lines, line = [], indent
    for number in numbers:
        if len(line) + len(number) + 2 > _WIDTH and line.strip():
            lines.append(line.rstrip())
            line = indent
        line += f"{number}, "
    return "\n".join([*lines, line.rstrip(", ")])


def _number(value: Any, kind: Number) -> str:
    if kind != REAL:
        assert kind == INT or value in (0, 1)
        return str(int(value))
    value = float(value)
    if np.isfinite(value):
        return f"R({value!r})"
    return "R(NAN)" if np.isnan(value) else f"R({'-' * (value < 0.0)}INFINITY)"
