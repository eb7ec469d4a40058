"""Scalar Python compiled by numba, and kept compiled; calls of a law's functions.

Numba sees whether the file of a cached function has changed, but not whether another file has
whose functions it calls. So the cache lies in a folder named after the contents of all kernels: an
edit of any of them is a new folder.
"""

import contextlib
import dis
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import cache, lru_cache, partial
from pathlib import Path
from types import CellType, CodeType, FunctionType
from typing import Any

import numba
from llvmlite import ir
from numba.core import types
from numba.core.caching import FunctionCache
from numba.core.compiler_lock import global_compiler_lock
from numba.extending import intrinsic

# Typed in some versions and not in others.
_numba: Any = numba
_HERE = Path(__file__).parent


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return a name for the contents of all files of this room, as this process found them."""
    digest = hashlib.sha256()
    for path in sorted(_HERE.glob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _cache_folder() -> Path | None:
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    asked, own = _numba.config.CACHE_DIR, _HERE / "__pycache__"
    for root in [Path(asked)] if asked else [own, Path(home) / "fpid_pin"]:
        folder = root / f"kernels-{source_stamp()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        if root == own:
            # What earlier states of this very room have left behind.
            for old in set(root.glob("kernels-*")) - {folder}:
                shutil.rmtree(old, ignore_errors=True)
        return folder
    return None


#: Where compiled kernels are kept; None: nowhere, they are compiled anew in every process.
CACHE = _cache_folder()


def is_cold() -> bool:
    """Return whether kernels are yet to be compiled on this machine, which takes some seconds."""
    return CACHE is None or next(CACHE.rglob("*.nbi"), None) is None


class _Cache(FunctionCache):
    """Numba's cache of one function; where it cannot be used, that costs time and nothing else."""

    def __init__(self, function: Any, key: str | None) -> None:
        self._key = key
        super().__init__(function)

    def _index_key(self, sig: Any, codegen: Any) -> Any:
        if self._key is not None:
            return (sig, codegen.magic_tuple(), self._key)
        return super()._index_key(sig, codegen)

    def load_overload(self, *arguments: Any) -> Any:
        return self._attempt(super().load_overload, *arguments)

    def save_overload(self, *arguments: Any) -> None:
        self._attempt(super().save_overload, *arguments)

    def _attempt(self, method: Callable[..., Any], *arguments: Any) -> Any:
        try:
            return method(*arguments)
        except Exception:  # a full disk; whatever a broken file raises
            # Nothing could be written beside it either, in any later process.
            with contextlib.suppress(Exception):
                self.flush()
            return None


def keep(compiled: Any, function: Any, key: str | None = None) -> None:
    """Let what numba compiles of a function be kept in `CACHE`.

    `key` names what it is made of, where the function's own code does not say all of that.
    """
    if CACHE is None:
        return
    before = _numba.config.CACHE_DIR
    _numba.config.CACHE_DIR = str(CACHE)
    # A function that was typed in stands in no file whose changes could be seen: a RuntimeError.
    with contextlib.suppress(RuntimeError):
        compiled._cache = _Cache(function, key)
    _numba.config.CACHE_DIR = before


@cache
def kernel(function: Any, inline: bool = False) -> Any:
    """Compile a scalar function at its first call, for the types that it is called with.

    Functions in plain Python that it calls become part of it; all that it calls must then be
    defined before it. No fast mathematics: sums stay in the order in which they are written,
    products and sums are rounded one by one, and a division by zero gives inf or NaN as in C.
    """
    # Kernels allocate nothing: no reference is counted. Nothing calls them through C pointers.
    options = {"_nrt": False, "no_cfunc_wrapper": True}
    compiled = _compile(function, partial(kernel, inline=True), forceinline=inline, **options)
    if compiled is not function:
        keep(compiled, compiled.py_func)
    return compiled


def compile_law(function: Any, *, inline: bool = False) -> Any:
    """Compile a function of a user's law, and those in plain Python that it calls."""
    return _compile(function, partial(compile_law, inline=True), forceinline=inline)


def _compile(function: Any, compile_called: Callable[[Any], Any], **options: Any) -> Any:
    """Compile a function that calls functions in plain Python, compiled by `compile_called`.

    LLVM inlines them: numba's own inlining would type and lower a function once for each call.
    """
    if _numba.config.DISABLE_JIT:
        return function
    known = globals_of(function)
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    if any(isinstance(value, FunctionType) for value in (*known.values(), *cells)):

        def ready(value: Any) -> Any:
            return compile_called(value) if isinstance(value, FunctionType) else value

        plain, known = function, {name: ready(value) for name, value in known.items()}
        function = FunctionType(
            plain.__code__, plain.__globals__ | known, plain.__name__, plain.__defaults__,
            tuple(CellType(ready(value)) for value in cells),
        )  # fmt: skip
        function.__qualname__, function.__module__ = plain.__qualname__, plain.__module__
    compiled: Any = _numba.njit(function, error_model="numpy", nogil=True, **options)
    compile_one = compiled.compile

    def compile_scalar(signature: Any) -> Any:
        """Compile for types of arguments, without turning loops into vector loops.

        Loops over joints are short. A vector loop first checks that its arrays do not overlap,
        which takes longer than the loop itself: a tenth to a fifth of a step. numba knows this as
        a setting of a process, which is put back, as a user's own functions may want it.
        """
        with global_compiler_lock:
            before = _numba.config.LOOP_VECTORIZE
            _numba.config.LOOP_VECTORIZE = 0
            try:
                return compile_one(signature)
            finally:
                _numba.config.LOOP_VECTORIZE = before

    compiled.compile = compile_scalar
    return compiled


def entry_point(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Return what a kernel is compiled to for arguments of these types, and compile it for them.

    It does not look up the types of its arguments again, which takes most of a short call with many
    arrays: whoever calls it sees to it that they stay the same.
    """
    if _numba.config.DISABLE_JIT:
        return function  # type: ignore[no-any-return]
    kinds = tuple(_numba.typeof(argument) for argument in arguments)
    function.compile(kinds)
    return function.overloads[kinds].entry_point  # type: ignore[no-any-return]


def globals_of(function: Any) -> dict[str, Any]:
    """Return the global names that a function uses, also in functions within it, and their values.

    Names of builtins are left out.
    """
    known = function.__globals__
    return {name: known[name] for name in _global_names(function.__code__) if name in known}


@lru_cache(maxsize=1024)
def _global_names(code: CodeType) -> frozenset[str]:
    """Return the global names in some code; not those of attributes, which may be the same."""
    found = {i.argval for i in dis.get_instructions(code) if i.opname == "LOAD_GLOBAL"}
    inner = [part for part in code.co_consts if isinstance(part, CodeType)]
    return frozenset(found.union(*map(_global_names, inner)))


# Calls of a law's functions. The engine is compiled once, whatever laws there are: a law's
# functions are compiled apart and called by their addresses. numba's own first-class functions do
# the same, but an argument of that kind takes 25 microseconds at each call from Python.


#: What a law's functions are called with: these arrays of `records.Controller`.
_GIVEN = ("numbers", "own", "bodies", "links", "motions", "gravity")


@intrinsic
def _call_compiled(typing_context, address, ctrl):
    """Type and generate a call of `call_law`."""

    def generate(context, builder, signature, arguments):
        pointer, size = ir.IntType(8).as_pointer(), ir.IntType(64)
        places = [ctrl.fields.index(name) for name in _GIVEN]
        given = [
            context.make_array(ctrl[k])(context, builder, builder.extract_value(arguments[1], k))
            for k in places
        ]
        data = [builder.bitcast(array.data, pointer) for array in given]
        # How many joints there are, and rows of the law's own arrays.
        sizes = [builder.extract_value(array.shape, 0) for array in given[:2]]
        kinds = [pointer] * len(data) + [size] * len(sizes)
        function = ir.FunctionType(ir.VoidType(), kinds).as_pointer()
        builder.call(builder.inttoptr(arguments[0], function), data + sizes)
        return context.get_dummy_value()

    return types.void(types.int64, ctrl), generate


#: Functions by address where nothing is compiled (NUMBA_DISABLE_JIT=1).
PLAIN: dict[int, Callable[..., None]] = {}


def _call_plain(address, ctrl):
    PLAIN[int(address)](*(getattr(ctrl, name) for name in _GIVEN))


#: ``call_law(address, ctrl)``, `ctrl` being a `records.Controller`.
call_law: Any = _call_plain if _numba.config.DISABLE_JIT else _call_compiled
