"""The C files of a law: header, printed kernels, constants."""

from __future__ import annotations

import math
import re
import zlib
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.export.c99 import C99, helpers
from fpid_pin.export.c_templates import HEADER, PARAMETERS, SOURCE
from fpid_pin.export.kinds import REAL, Array, Number, Record
from fpid_pin.export.law import INPUTS, bundle, real, stand_ins
from fpid_pin.export.printer import Program

if TYPE_CHECKING:
    from fpid_pin.control.state import State

_LANGUAGE = C99()
_WIDTH = 100
#: Arrays of a controller that no tick writes to.
_FIXED = ("poles", "table", "bodies", "gravity")
#: What is rounded in one way here and in another there.
_INEXACT = re.compile(r"\b(exp|expm1|log|log1p|pow|\w*sin|\w*cos|\w*tan|\w*[sc]?anh|hypot)\w*\(")


class CSource:
    """The text of a law's C files.

    Parameters
    ----------
    state
        At t = 0: see `law.start`.

    Attributes
    ----------
    header, source, parameters
        Of ``fpid.h``, ``fpid.c`` and ``fpid_parameters.c``.
    exact
        Whether it has only operations in it whose bits are the same everywhere.
    """

    def __init__(self, state: State) -> None:
        from fpid_pin.kernels import tick

        n = state.n
        texts = {name: f"{{}}->{name}" for name in state.c._fields}
        texts |= {name: f"fpid_{name}" for name in _FIXED} | {"numbers": "((real_t *){}->joints)"}
        arrays = bundle("state", state.c, texts, record=state.record)
        program = Program(_LANGUAGE, stand_ins(state.controller))
        given = {"c": "state", "inputs": "inputs", "torque": "output->torque"}
        calls = []
        for kernel, kinds in (
            (tick.signals, [real(INPUTS, n)]), (tick.ask_model, [real(INPUTS, n)]),
            (tick.torques, [real(n)]), (tick.adapt, []),
        ):  # fmt: skip
            part = program.add(kernel, [arrays, *kinds])
            arguments = ", ".join(given[p.name] for p in part.parameters if p.taken)
            calls.append(f"    {part.name}({arguments});")
        text = program.text
        used = set(re.findall(r"(?:->|\bfpid_)(\w+)", text)) | {"robot", "joints"}
        #: Name, kind and values of the arrays that are used.
        self._arrays = [
            (name, kind, state.joints if name == "joints" else getattr(state.c, name))
            for name, kind, _ in arrays.members
            if name in used - {"numbers"} and getattr(state.c, name).size
        ]
        self.exact = _INEXACT.search(text) is None
        constants = [part for part in self._arrays if part[0] in _FIXED or np.any(_flat(part[2]))]
        self.parameters = PARAMETERS.format(
            version=__version__,
            constants="\n".join(
                f"const {_declared(name, kind)} = {_values(kind, values)};\n"
                for name, kind, values in constants
            ),
        )
        stamp = zlib.crc32((self.parameters + text).encode()) & 0x7FFFFFFF
        moving = [(name, kind) for name, kind, _ in self._arrays if name not in _FIXED]
        elements = [kind.element for _, kind, _ in self._arrays]
        records = {e.name: e for e in elements if isinstance(e, Record)}
        self.header = HEADER.format(
            version=__version__, step=repr(float(state.step)), n=n, stamp=stamp,
            structs=_LANGUAGE.structs(records.values()),
            moving="\n".join(
                f"    {_LANGUAGE.type_of(kind)} {name}{_extent(kind)};" for name, kind in moving
            ),
            constants="\n".join(
                f"extern const {_declared(name, kind)};" for name, kind, _ in constants
            ),
        )  # fmt: skip
        self.source = SOURCE.format(
            version=__version__, inputs=INPUTS, helpers=helpers(text), functions=text,
            tick="\n".join(calls),
            reset="\n".join(
                f"    memcpy(state->{name}, fpid_{name}_0, sizeof fpid_{name}_0);"
                for name, _, _ in constants
                if name not in _FIXED
            ),
        )  # fmt: skip


def _flat(values: Any) -> Any:
    """Return all numbers of an array."""
    names = values.dtype.names
    return values if names is None else np.array([values[name] for name in names])


def _declared(name: str, kind: Array) -> str:
    """Return the declaration of a constant: an array, or its contents at t = 0."""
    start = "" if name in _FIXED else "_0"
    return f"{_LANGUAGE.type_of(kind)} fpid_{name}{start}{_extent(kind)}"


def _extent(kind: Array) -> str:
    return f"[{math.prod(extent or 0 for extent in kind.shape)}]"


def _values(kind: Array, values: Any) -> str:
    """Return the initial values of a constant, an element a line."""
    flat = np.asarray(values).reshape(-1)
    if not isinstance(kind.element, Record):
        return "{\n" + _wrapped([_number(one, REAL) for one in flat], "    ") + "\n}"
    fields = kind.element.kept
    return "{\n" + ",\n".join(_row([_number(one[f], k) for f, k in fields]) for one in flat) + "\n}"


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
        return str(int(value))
    value = float(value)
    if np.isfinite(value):
        return f"R({value!r})"
    return "R(NAN)" if np.isnan(value) else f"R({'-' * (value < 0.0)}INFINITY)"
