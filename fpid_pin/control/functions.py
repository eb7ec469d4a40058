"""A law's functions made ready for the engine: compiled apart, checked, called by address.

What a law's function compiles to is kept on disk under a name made of its own code and of all that
it uses, so that an edited law is another one, and a moved or deleted one harms nobody.
"""

from __future__ import annotations

import hashlib
import itertools
import traceback
from collections.abc import Callable
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, NamedTuple

import numba
import numpy as np
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.core.sigutils import normalize_signature

from fpid_pin.exceptions import FpidError, SimulationError
from fpid_pin.kernels import compiled
from fpid_pin.kernels.call import PLAIN
from fpid_pin.kernels.compiled import compile_plain, globals_of
from fpid_pin.kernels.records import BODY, LINK

_numba: Any = numba
_CFunc: Any = CFunc
_normalized: Any = normalize_signature


class Model(NamedTuple):
    """The nominal model, for laws of the whole robot: see `kernels.records.Controller`."""

    bodies: Any
    links: Any
    motions: Any
    gravity: Any


def address_of(function: Any, record: Any, *, whole: bool = False, columns: int = 0) -> int:
    """Return the address of a law's function, for `kernels.call`; the same one for the same code.

    Parameters
    ----------
    function
        ``surface``, ``torque`` or ``adapt`` of a joint, or a function of the whole robot.
    record
        Type of a joint's record.
    whole
        Whether it is of the whole robot.
    columns
        Of the law's own arrays.

    Raises
    ------
    SimulationError
        A function that cannot be compiled; the message names its line.
    """
    function = plain_function(function)
    stamp = _stamp(function)
    key = (stamp, record.names, function.__name__, whole, columns)
    if stamp is None or key not in _KNOWN:
        found = _bind(function, record, whole, columns, key)
        if stamp is None:
            key = (str(next(_COUNT)), *key[1:])
        _KNOWN[key] = found
    return _KNOWN[key][0]


#: Addresses, and what keeps the code that they point to alive.
_KNOWN: dict[Any, tuple[int, Any]] = {}
_COUNT = itertools.count(1)


def plain_function(function: Any) -> Any:
    """Return the function itself of a method or of what numba has made of it."""
    function = getattr(function, "__func__", function)
    return getattr(function, "py_func", function)


def _bind(function: Any, record: Any, whole: bool, columns: int, key: Any) -> tuple[int, Any]:
    if _numba.config.DISABLE_JIT:
        address = next(_COUNT)
        PLAIN[address] = _in_python(function, record, whole)
        return address, None
    try:
        called = _over_arrays(
            compile_plain(function, cache=False), function.__name__, whole, columns
        )
        return _compiled(called, _signature(record), key)
    except FpidError:
        raise
    except Exception as error:
        code = function.__code__
        lines = [line for line in str(error).splitlines() if line.strip()]
        place = next((line for line in lines if line.startswith("File ")), "")
        line = place.rpartition("line ")[2].rstrip(":").strip() or str(code.co_firstlineno)
        reason = next(
            (x for x in lines if not x.startswith(("Failed", "File"))), type(error).__name__
        )
        raise SimulationError(
            f"the law's {function.__name__} cannot be compiled (line {line} of "
            f"{_short(code.co_filename)}): {reason.strip()}"
        ) from error


def _short(path: str) -> str:
    return path.replace("\\", "/").rpartition("/")[2]


def _signature(record: Any) -> Any:
    types = _numba.types
    pointers = [types.CPointer(_numba.from_dtype(d)) for d in (record, BODY, LINK)]
    reals = types.CPointer(types.float64)
    joints, bodies, links = pointers
    return types.void(joints, reals, bodies, links, reals, reals, types.int64, types.int64)


def _over_arrays(inner: Any, name: str, whole: bool, columns: int) -> Callable[..., None]:
    """Return what calls a law's function for all joints, with the arguments of `call_law`."""
    carray = _numba.carray
    if whole:

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
    if name == "torque":

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


def _in_python(function: Any, record: Any, whole: bool) -> Callable[..., None]:
    """Return the same without compilation."""

    def call(numbers, own, bodies, links, motions, gravity):  # type: ignore[no-untyped-def]
        joints = numbers.view(record)[:, 0]
        if whole:
            function(joints, own, Model(bodies, links, motions, gravity))
            return
        for c in joints:
            if function.__name__ == "torque":
                c.u_law = c.scale * function(c)
            else:
                function(c)

    return call


class _Cache(FunctionCache):
    """numba's cache on disk, with a key of our own in place of the code's bytes."""

    def __init__(self, function: Any, key: str) -> None:
        self._own_key = key
        super().__init__(function)  # type: ignore[no-untyped-call]

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        return (sig, codegen.magic_tuple(), self._own_key)


def _compiled(called: Any, signature: Any, key: Any) -> tuple[int, Any]:
    result: Any = _CFunc(called, _normalized(signature), {}, {"error_model": "numpy"})
    if key[0] is not None and compiled.CACHE is not None:
        digest = hashlib.sha256(repr(key).encode()).hexdigest()
        before = _numba.config.CACHE_DIR
        _numba.config.CACHE_DIR = str(compiled.CACHE)
        try:
            # An index of its own for each function: what breaks one leaves the others alone.
            called.__qualname__ = f"law_{key[2]}_{digest[:16]}"
            result._cache = _Cache(called, digest)
            compiled._forgive(result._cache)
        except RuntimeError:
            pass
        finally:
            _numba.config.CACHE_DIR = before
    result.compile()
    return int(result.address), result


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


def check_in_python(function: Any, *arguments: Any, who: str) -> None:
    """Run a law's function once in Python, which names the line of a fault that compiling hides.

    Raises
    ------
    SimulationError
        It raises, or asks for a number that the law has not.
    """
    function = plain_function(function)
    try:
        with np.errstate(all="ignore"):
            function(*arguments)
    except Exception as error:
        frames = traceback.extract_tb(error.__traceback__)
        here = [f for f in frames if f.filename == function.__code__.co_filename] or list(frames)
        raise SimulationError(
            f"{who}.{function.__name__}, line {here[-1].lineno} of {_short(here[-1].filename)}: "
            f"{type(error).__name__}: {error}"
        ) from error


__all__ = ["Model", "address_of", "check_in_python", "plain_function"]
