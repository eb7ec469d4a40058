"""The C files of a law: header, printed kernels, constants."""

from __future__ import annotations

import math
import re
import textwrap
import zlib
from functools import partial
from importlib import resources
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.export.c99 import C99, helpers
from fpid_pin.export.kinds import INT, Array, Kind, Number, Record, bundle, real
from fpid_pin.export.law import INPUTS, stand_ins
from fpid_pin.export.printer import Program

if TYPE_CHECKING:
    from fpid_pin.control.state import State

_LANGUAGE = C99()
#: Arrays of a controller that no tick writes to.
_FIXED = ("poles", "table", "bodies", "gravity")
#: What is rounded in one way here and in another there.
_INEXACT = re.compile(r"\b(exp|expm1|log|log1p|pow|\w*sin|\w*cos|\w*tan|\w*[sc]?anh|hypot)\w*\(")
#: Files that are the same for every law.
_COPIED = ("example.c", "fpid_check.c", "CMakeLists.txt")


def template(name: str) -> str:
    """Return the text of a file in `templates`."""
    place = resources.files("fpid_pin.export") / "templates" / name
    return place.read_text(encoding="utf-8")


class CSource:
    """A law's C files, from its state at t = 0 (`law.start`): texts by name.

    `exact` is whether all operations in it have the same bits everywhere.
    """

    def __init__(self, state: State) -> None:
        from fpid_pin.kernels import tick

        arrays: dict[str, Any] = {**state.c._asdict(), "joints": state.joints}
        texts = {name: f"{{}}->{name}" for name in arrays}
        texts |= {name: f"fpid_{name}" for name in _FIXED} | {"numbers": "((real_t *){}->joints)"}
        controller = bundle("state", arrays, texts, fixed=_FIXED)
        program = Program(_LANGUAGE, stand_ins(state.controller))
        given = {"c": "state", "inputs": "inputs", "torque": "output->torque"}
        calls = []
        for kernel, names in (
            (tick.signals, ["c", "inputs"]), (tick.evaluate_model, ["c", "inputs"]),
            (tick.torques, ["c", "torque"]), (tick.adapt, ["c"]),
        ):  # fmt: skip
            kinds: dict[str, Kind] = {
                "c": controller,
                "inputs": real(INPUTS, state.n),
                "torque": real(state.n),
            }
            part = program.add(kernel, [kinds[name] for name in names])
            taken = [given[x] for x, used in zip(names, part.taken, strict=True) if used]
            calls.append(f"    {part.name}({', '.join(taken)});")
        text = program.text
        self.exact = _INEXACT.search(text) is None
        used = set(re.findall(r"(?:->|\bfpid_)(\w+)", text)) | {"robot", "joints"}
        kept = [
            (name, kind)
            for name, kind, _ in controller.members
            if name in used - {"numbers"} and arrays[name].size
        ]
        # A state is zero at t = 0 but for arrays that are not.
        constants = [(name, kind) for name, kind in kept if name in _FIXED or _some(arrays[name])]
        parameters = [f"const {_type(*x)} = {_values(x[1], arrays[x[0]])};\n" for x in constants]
        records = [kind.element for _, kind in kept if isinstance(kind.element, Record)]
        fill = partial(
            _fill, version=__version__, step=repr(float(state.step)), n=state.n,
            tolerance="0.0" if self.exact else "1e-12",
            stamp=zlib.crc32("".join([*parameters, text]).encode()) & 0x7FFFFFFF,
            structs=_LANGUAGE.structs({record.name: record for record in records}.values()),
            moving=[f"    {_type(*x, prefix='', start='')};" for x in kept if x[0] not in _FIXED],
            declared=[f"extern const {_type(*x)};" for x in constants],
            constants=parameters, helpers=helpers(text), functions=text, tick=calls,
            reset=[
                f"    memcpy(state->{name}, fpid_{name}_0, sizeof fpid_{name}_0);"
                for name, _ in constants
                if name not in _FIXED
            ],
        )  # fmt: skip
        self.files = {name: fill(name) for name in ("fpid.h", "fpid.c", "fpid_parameters.c")}
        self.files |= {name: template(name) for name in _COPIED}


def _fill(name: str, **values: Any) -> str:
    """Return a file of `templates` with values in their places; lists are lines."""
    lines = {key: "\n".join(x) if isinstance(x, list) else x for key, x in values.items()}
    return Template(template(name)).substitute(lines)


def _some(values: Any) -> bool:
    """Return whether an array has any number but 0."""
    names = values.dtype.names
    return bool(np.any(values) if names is None else any(np.any(values[name]) for name in names))


def _type(name: str, kind: Array, *, prefix: str = "fpid_", start: str = "_0") -> str:
    """Return the declaration of an array: a constant, or its contents at t = 0."""
    size = math.prod(extent or 0 for extent in kind.shape)
    return f"{_LANGUAGE.type_of(kind)} {prefix}{name}{'' if name in _FIXED else start}[{size}]"


def _values(kind: Array, values: Any) -> str:
    """Return the initial values of a constant, an element a line."""
    flat = np.asarray(values).reshape(-1)
    if not isinstance(kind.element, Record):
        return "{\n" + _wrapped([_number(one, kind.element) for one in flat]) + "\n}"
    fields = kind.element.kept
    rows = [_wrapped([_number(one[f], k) for f, k in fields], "    {", "}") for one in flat]
    return "{\n" + ",\n".join(rows) + "\n}"


def _wrapped(numbers: list[str], before: str = "    ", after: str = "") -> str:
    """Return numbers in lines of a hundred characters."""
    text = f"{before}{', '.join(numbers)}{after}"
    return textwrap.fill(text, 100, subsequent_indent=" " * len(before), break_on_hyphens=False)


def _number(value: Any, kind: Number) -> str:
    if kind == INT:
        return str(int(value))
    value = float(value)
    if np.isfinite(value):
        return f"R({value!r})"
    return "R(NAN)" if np.isnan(value) else f"R({'-' * (value < 0.0)}INFINITY)"
