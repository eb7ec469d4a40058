"""A law for the printer: its functions in the place of calls by address; and its C files."""

from __future__ import annotations

import ast
import math
import re
import textwrap
import zlib
from collections.abc import Callable, Sequence
from functools import partial
from importlib import resources
from pathlib import Path
from string import Template
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin._version import __version__
from fpid_pin.exceptions import ExportError
from fpid_pin.export.c99 import C99, helpers
from fpid_pin.export.kinds import INT, Array, Kind, Number, Record, bundle, real, words
from fpid_pin.export.printer import Instead, Program

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control import Controller
    from fpid_pin.control.state import State

#: Joints that an export is meant for. Beyond, M and its factors are most of the memory.
MOST_JOINTS = 32
#: What a tick is given: q, v, and q, v, a of the reference, each (n,), one after the other.
INPUTS = 5
_LANGUAGE = C99()
#: Arrays of a controller that no tick writes to.
_FIXED = ("poles", "table", "bodies", "gravity")
#: What is rounded in one way here and in another there.
_INEXACT = re.compile(r"\b(exp|expm1|log|log1p|pow|\w*sin|\w*cos|\w*tan|\w*[sc]?anh|hypot)\w*\(")
#: Files that are the same for every law.
_COPIED = ("example.c", "fpid_check.c", "CMakeLists.txt")


def start(controller: Controller, arm: Arm, step: float, horizon: float) -> State:
    """Return the state at t = 0 of a controller that can be printed; ExportError if none can."""
    from fpid_pin.control.state import State

    if arm.n > MOST_JOINTS:
        raise ExportError(f"arm: expected at most {MOST_JOINTS} joints, got {arm.n}")
    state = State(controller, arm, step=step, horizon=horizon)
    if state.in_python:
        raise ExportError(
            f"{type(state.controller).__name__}: expected a law by its functions surface, torque, "
            "adapt, got one in plain Python (CONTRIBUTING.md has both)"
        )
    return state


def by_name(controller: Controller) -> Instead:
    """Return what puts a law's functions, for `Program`, in the place of calls by address."""
    from fpid_pin.control.functions import plain_function
    from fpid_pin.kernels.compiled import call_law

    def instead(kernel: Any, arguments: Sequence[ast.expr]) -> tuple[Any, Sequence[ast.expr]]:
        if kernel is not call_law:
            return kernel, arguments
        address, ctrl = arguments
        assert isinstance(address, ast.Attribute)
        # The joints' whole records are another array of the controller.
        each = ast.copy_location(ast.Attribute(ctrl, "joints"), ctrl)
        if controller.torques is not None:
            # A law of the whole robot; its model is arrays of the controller.
            function = getattr(controller, {"torque": "torques", "adapt": "adapts"}[address.attr])
            own = ast.copy_location(ast.Attribute(ctrl, "own"), ctrl)
            return plain_function(function), [each, own, ctrl]
        function = plain_function(getattr(controller, address.attr))
        return _of_each(function, address.attr), [each]

    return instead


def _of_each(law_function: Any, name: str) -> Callable[..., None]:
    """Return a kernel that calls a law's function for each joint."""

    def torque_of_each(joints):  # type: ignore[no-untyped-def]
        """Write the law's own torque of each joint."""
        for j in range(joints.size):
            c = joints[j]
            c.u_law = c.scale * law_function(c)

    def call_each(joints):  # type: ignore[no-untyped-def]
        """Call the law's function for each joint."""
        for j in range(joints.size):
            law_function(joints[j])

    call_each.__name__ = f"{name}_of_each"
    return torque_of_each if name == "torque" else call_each


def template(name: str) -> str:
    """Return the text of a file in `templates`."""
    place = resources.files("fpid_pin.export") / "templates" / name
    return place.read_text(encoding="utf-8")


class CSource:
    """A law's C files, from its state at t = 0 (`start`): texts by name.

    `exact` is whether all operations in it have the same bits everywhere.
    """

    def __init__(self, state: State) -> None:
        from fpid_pin.kernels import tick

        arrays: dict[str, Any] = {**state.c._asdict(), "joints": state.joints}
        texts = {name: f"{{}}->{name}" for name in arrays}
        texts |= {name: f"fpid_{name}" for name in _FIXED} | {"numbers": "((real_t *){}->joints)"}
        controller = bundle("state", arrays, texts, fixed=_FIXED)
        program = Program(_LANGUAGE, by_name(state.controller))
        kinds: dict[str, Kind] = {
            "state": controller, "inputs": real(INPUTS, state.n), "output->torque": real(state.n),
        }  # fmt: skip
        calls = []
        for kernel, given in (
            (tick.signals, ["state", "inputs"]), (tick.evaluate_model, ["state", "inputs"]),
            (tick.torques, ["state", "output->torque"]), (tick.adapt, ["state"]),
        ):  # fmt: skip
            part = program.add(kernel, [kinds[name] for name in given])
            taken = [name for name, used in zip(given, part.taken, strict=True) if used]
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
        constants = [x for x in kept if x[0] in _FIXED or words(arrays[x[0]]).any()]
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

    def write(self, folder: Path) -> None:
        """Write all that is compiled, and how, into a folder that exists."""
        for name, text in self.files.items():
            (folder / name).write_text(text, encoding="utf-8")


def _fill(name: str, **values: Any) -> str:
    """Return a file of `templates` with values in their places; lists are lines."""
    lines = {key: "\n".join(x) if isinstance(x, list) else x for key, x in values.items()}
    return Template(template(name)).substitute(lines)


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
    return f"R({float(value)!r})".replace("inf", "INFINITY").replace("nan", "NAN")
