"""A law's functions made ready for the engine: compiled apart, checked, called by address.

What a law's function compiles to is kept on disk under a name made of its own code and of all that
it uses, so that an edited law is another one, and a moved or deleted one harms nobody.
"""

import dis
import hashlib
import itertools
import re
import traceback
from collections.abc import Callable, Iterator, Sequence
from pathlib import PurePath
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.ccallback import CFunc
from numba.core.sigutils import normalize_signature

from fpid_pin.exceptions import SimulationError
from fpid_pin.kernels import compiled
from fpid_pin.kernels.compiled import PLAIN, compile_law, globals_of
from fpid_pin.kernels.records import BODY, LINK

_numba: Any = numba
_CFunc: Any = CFunc
_normalized: Any = normalize_signature
_OPTIONS = {"error_model": "numpy"}


class Model(NamedTuple):
    """The nominal model, for laws of the whole robot: see `kernels.records.Controller`."""

    bodies: Any
    links: Any
    motions: Any
    gravity: Any


#: What a law's function is called with, by what it does: ``surface`` and ``adapt`` of a joint write
#: its record, ``torque`` returns a number, the others are of the whole robot.
ARGUMENTS = {"joint": ("c",), "torque": ("c",), "robot": ("joints", "own", "model")}


def address_of(function: Any, record: Any, role: str, *, columns: int = 0) -> int:
    """Return the address of a law's function, for `call_law`; the same one for the same code.

    `record` is the type of a joint's record, `role` one of `ARGUMENTS`, `columns` those of the
    law's own arrays. A function that cannot be compiled is a SimulationError that names its line.
    """
    function = plain_function(function)
    stamp = _stamp(function)
    # What is not known by all that it uses is compiled each time, and not kept on disk.
    key = (stamp or str(next(_COUNT)), record.names, role, columns)
    if key not in _KNOWN:
        digest = hashlib.sha256(repr(key).encode()).hexdigest() if stamp else None
        _KNOWN[key] = _bind(function, record, role, columns, digest)
    return _KNOWN[key][0]


#: Addresses, and what keeps the code that they point to alive.
_KNOWN: dict[Any, tuple[int, Any]] = {}
_COUNT = itertools.count(1)


def plain_function(function: Any) -> Any:
    """Return the function itself of a method or of what numba has made of it."""
    function = getattr(function, "__func__", function)
    return getattr(function, "py_func", function)


def _bind(
    function: Any, record: Any, role: str, columns: int, digest: str | None
) -> tuple[int, Any]:
    """Return the address of a function with the arguments of `call_law`, and what keeps it."""
    if _numba.config.DISABLE_JIT:
        address = next(_COUNT)
        plain = _over_arrays(function, role, columns, lambda array, _: array)
        PLAIN[address] = lambda numbers, own, *model: plain(
            numbers.view(record)[:, 0], own, *model, len(numbers), len(own)
        )
        return address, None
    types = _numba.types
    pointers = [types.CPointer(_numba.from_dtype(d)) for d in (record, BODY, LINK)]
    reals = types.CPointer(types.float64)
    arguments = (pointers[0], reals, *pointers[1:], reals, reals, types.int64, types.int64)
    try:
        called = _over_arrays(compile_law(function), role, columns, _numba.carray)
        result: Any = _CFunc(called, _normalized(types.void(*arguments)), {}, _OPTIONS)
        if digest is not None:
            # An index of its own for each function: what breaks one leaves the others alone.
            called.__qualname__ = f"law_{role}_{digest[:16]}"
            compiled.keep(result, called, digest)
        result.compile()
    except Exception as error:
        place, reason = _fault(function, error)
        raise SimulationError(
            f"the law's {function.__name__} cannot be compiled ({place}): {reason}"
        ) from error
    return int(result.address), result


def _fault(function: Any, error: Exception) -> tuple[str, str]:
    """Return where a function cannot be compiled, line and file, and why."""
    code = function.__code__
    place = f"line {code.co_firstlineno} of {PurePath(code.co_filename).name}"
    if isinstance(error, KeyError):
        # All that numba says of a number that a record has not is its name.
        name = str(error.args[0])
        uses = (
            at
            for at, instruction in _instructions(function, called=True)
            if instruction.argval == name and instruction.opname.endswith("_ATTR")
        )
        return next(uses, place), f"the law has no number '{name}'"
    text = re.sub(r"\x1b\[[\d;]*m", "", str(error))  # numba colours it where colorama is there
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    # The innermost function comes first.
    found = re.search(r'File "(.+)", line (\d+):', text)
    if found is not None:
        place = f"line {found[2]} of {PurePath(found[1]).name}"
    reason = next((x for x in lines if not x.startswith(("Failed", "File"))), type(error).__name__)
    return place, reason


def _instructions(function: Any, *, called: bool) -> Iterator[tuple[str, dis.Instruction]]:
    """Yield what a function, and perhaps those in plain Python that it calls, are made of."""
    code = function.__code__
    for instruction in dis.get_instructions(code):
        line = instruction.positions.lineno if instruction.positions else code.co_firstlineno
        yield f"line {line} of {PurePath(code.co_filename).name}", instruction
    for inner in globals_of(function).values() if called else ():
        if isinstance(inner, FunctionType) and inner is not function:
            yield from _instructions(inner, called=True)


def _lost_when_compiled(function: Any, role: str) -> str:
    """Say where a function raises, or returns nothing: compiled, it would go on with any number."""
    for place, instruction in _instructions(function, called=True):
        if instruction.opname == "RAISE_VARARGS":
            return f"{place}: expected no raise or assert, which compiled code cannot stop at"
    constant: Any = ()
    for place, instruction in _instructions(function, called=False):
        name, value = instruction.opname, instruction.argval
        constant = value if name.endswith("_CONST") else constant
        if role == "torque" and name.startswith("RETURN_") and constant is None:
            return f"{place}: expected a number to be returned on every way, got none"
        constant = constant if name.endswith("_CONST") else ()
    return ""


def _over_arrays(inner: Any, role: str, columns: int, carray: Any) -> Callable[..., None]:
    """Return what calls a law's function for all joints, with the arguments of `call_law`.

    `carray` makes an array of a pointer and a shape.
    """
    if role == "robot":

        def call_whole(joints, own, bodies, links, motions, gravity, n, rows):  # type: ignore[no-untyped-def]
            inner(
                carray(joints, (n,)),
                carray(own, (rows, columns)),
                Model(
                    carray(bodies, (n,)), carray(links, (n,)), carray(motions, (3, n, 6)),
                    carray(gravity, (3,)),
                ),
            )  # fmt: skip

        return call_whole
    if role == "torque":

        def call_torque(joints, own, bodies, links, motions, gravity, n, rows):  # type: ignore[no-untyped-def]
            c = carray(joints, (n,))
            for j in range(n):
                c[j].u_law = c[j].scale * inner(c[j])

        return call_torque

    def call_each(joints, own, bodies, links, motions, gravity, n, rows):  # type: ignore[no-untyped-def]
        c = carray(joints, (n,))
        for j in range(n):
            inner(c[j])

    return call_each


def _stamp(function: Any, known: frozenset[int] = frozenset()) -> str | None:
    """Return a name for a function's code and all that it uses; None where that is not known.

    Code, constants and defaults, the values of its globals and closed-over names, and the same of
    all functions in plain Python that it calls; `known` are those that it is called by.
    """
    if id(function) in known:
        return ""
    code, cells = function.__code__, function.__closure__ or ()
    used = globals_of(function)
    used |= zip(code.co_freevars, (cell.cell_contents for cell in cells), strict=True)
    parts = [compiled.source_stamp(), _code_text(code)]
    parts.append(f"{function.__defaults__!r} {function.__kwdefaults__!r}")
    for name, value in sorted(used.items()):
        found = _stamp_of_value(value, set(code.co_names), known | {id(function)})
        if found is None:
            return None
        parts.append(f"{name}={found}")
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _stamp_of_value(value: Any, names: set[str], known: frozenset[int]) -> str | None:
    """Return a name for a value that a function uses; of a module, for its `names`."""
    value = getattr(value, "py_func", value)
    if isinstance(value, FunctionType):
        return _stamp(value, known)
    if isinstance(value, (bool, int, float, str, tuple, type(None), np.generic)):
        return repr(value)
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, ModuleType) and value.__name__ in ("math", "numpy"):
        return value.__name__
    if isinstance(value, ModuleType):
        inner = {name: getattr(value, name) for name in sorted(names) if hasattr(value, name)}
        stamps = {name: _stamp_of_value(x, names, known) for name, x in inner.items()}
        return None if None in stamps.values() else repr(stamps)
    if isinstance(value, (BuiltinFunctionType, np.ufunc, type)):
        return f"{getattr(value, '__module__', '')}.{value.__name__}"
    return None


def _code_text(code: CodeType) -> str:
    consts = [_code_text(c) if isinstance(c, CodeType) else repr(c) for c in code.co_consts]
    return repr((code.co_name, code.co_code.hex(), consts, code.co_names, code.co_varnames))


def check_in_python(function: Any, role: str, calls: Sequence[Any], *, who: str) -> None:
    """Call a user's function in Python, which names the line of a fault that compiling hides.

    `who` is the law, and what the function is to it. A SimulationError says where it takes other
    arguments, raises, or returns no number though its role is to.
    """
    function = plain_function(function)
    code = getattr(function, "__code__", None)
    if code is None:
        raise SimulationError(f"{who}: expected a function, got {type(function).__name__}")
    if function.__module__.partition(".")[0] == __name__.partition(".")[0]:
        return
    file, line = PurePath(code.co_filename).name, code.co_firstlineno
    expected, names = ARGUMENTS[role], code.co_varnames[: code.co_argcount]
    fault = ""
    if len(names) != len(expected):
        wanted, got = ", ".join(expected), ", ".join(names)
        fault, calls = f"expected a static method of ({wanted}), got ({got})", ()
    try:
        with np.errstate(all="ignore"):
            results = [function(*arguments) for arguments in calls]
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        here = [f for f in frames if f.filename == code.co_filename]
        line = here[-1].lineno or line if here else line
        fault, results = f"{type(error).__name__}: {error}", []
        if isinstance(error, AttributeError) and isinstance(error.obj, np.record):
            fault = f"the law has no number '{error.name}' (a field of a dataclass, or remembered)"
    for result in results if role == "torque" else ():
        if not isinstance(result, (float, int, np.floating, np.integer)):
            fault = f"expected a number to be returned, got {type(result).__name__}"
    if fault:
        raise SimulationError(f"{who}, line {line} of {file}: {fault}")
    if lost := _lost_when_compiled(function, role):
        raise SimulationError(f"{who}, {lost}")
