"""The one decorator of this room: scalar Python compiled by numba, and kept compiled.

Numba sees whether the file of a cached function has changed, but not whether another file has
whose functions it calls. So the cache lies in a folder named after the contents of all kernels: an
edit of any of them is a new folder.
"""

from __future__ import annotations

import contextlib
import dis
import hashlib
import os
import shutil
import tempfile
from collections.abc import Callable
from functools import lru_cache, partial
from pathlib import Path
from types import CellType, CodeType, FunctionType
from typing import Any, TypeVar, cast, overload

import numba

# Typed in some versions and not in others.
_numba: Any = numba

F = TypeVar("F", bound=Callable[..., Any])

_HERE = Path(__file__).parent


@lru_cache(maxsize=1)
def source_stamp() -> str:
    """Return a name for the contents of all files of this room, as this process found them."""
    digest = hashlib.sha256()
    for path in sorted(_HERE.glob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _roots() -> list[Path]:
    """Return where compiled kernels may be kept, the best first."""
    asked = _numba.config.CACHE_DIR
    if asked:
        return [Path(asked)]
    home = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    return [_HERE / "__pycache__", Path(home) / "fpid_pin"]


def cache_folder() -> Path | None:
    """Return the folder that compiled kernels are kept in; None where none can be written."""
    for root in _roots():
        folder = root / f"kernels-{source_stamp()}"
        try:
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
        except OSError:
            continue
        if root.parent == _HERE:
            # What earlier states of this very room have left behind.
            for old in set(root.glob("kernels-*")) - {folder}:
                shutil.rmtree(old, ignore_errors=True)
        return folder
    return None


#: Where compiled kernels are kept; None: nowhere, they are compiled anew in every process.
CACHE = cache_folder()


def is_cold() -> bool:
    """Return whether kernels are yet to be compiled on this machine, which takes some seconds."""
    return CACHE is None or next(CACHE.rglob("*.nbi"), None) is None


@overload
def kernel(function: F) -> F: ...
@overload
def kernel(*, inline: bool) -> Callable[[F], F]: ...
@overload
def kernel(function: F, *, inline: bool) -> F: ...


def kernel(function: F | None = None, *, inline: bool = False) -> F | Callable[[F], F]:
    """Compile a scalar function at its first call, for the types that it is called with.

    No fast mathematics: sums stay in the order in which they are written, products and sums are
    rounded one by one, and a division by zero gives inf or NaN as in C.

    Parameters
    ----------
    function
        Of the subset that this room's docstring names.
    inline
        Whether it becomes part of the kernels that call it: for what stands in their inner loops.
    """
    if function is None:
        return partial(_compile, inline=inline)
    return _compile(function, inline=inline)


def entry_point(function: Any, *arguments: Any) -> Callable[..., Any]:
    """Return what a kernel is compiled to for arguments of these types, and compile it for them.

    It does not look up the types of its arguments again, which takes most of a short call with many
    arrays: whoever calls it sees to it that they stay the same.
    """
    if not hasattr(function, "overloads"):
        return cast("Callable[..., Any]", function)
    types = tuple(_numba.typeof(argument) for argument in arguments)
    function.compile(types)
    return cast("Callable[..., Any]", function.overloads[types].entry_point)


def compile_plain(function: F, *, cache: bool = True, inline: bool = False) -> F:
    """Compile a function in plain Python, and the functions in plain Python that it calls.

    Parameters
    ----------
    function
        Of the subset; not one that is compiled already.
    cache
        Whether to keep it for other processes, which do not see edits outside this room.
    inline
        Whether it becomes part of what calls it; what it calls itself becomes part of it.
    """
    plain: Any = function

    def compiled(value: Any) -> Any:
        if isinstance(value, FunctionType):
            return compile_plain(value, cache=cache, inline=True)
        return value

    names = {name: compiled(value) for name, value in globals_of(plain).items()}
    cells = tuple(CellType(compiled(cell.cell_contents)) for cell in plain.__closure__ or ())
    rebuilt = FunctionType(
        plain.__code__, plain.__globals__ | names, plain.__name__, plain.__defaults__, cells
    )
    rebuilt.__qualname__, rebuilt.__module__ = plain.__qualname__, plain.__module__
    if cache:
        return cast("F", _compile(rebuilt, inline=inline))
    options = {"error_model": "numpy", "nogil": True, "forceinline": inline}
    return cast("F", _without_vectorising(_numba.njit(rebuilt, **options)))


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


def _compile(function: F, *, inline: bool) -> F:
    options = {
        "error_model": "numpy", "nogil": True,
        # Kernels allocate nothing: no reference is counted.
        "_nrt": False,
        # LLVM inlines: numba's own inlining would type and lower a function once for each call.
        "forceinline": inline,
        # Nothing calls kernels through C pointers.
        "no_cfunc_wrapper": True,
    }  # fmt: skip
    if CACHE is None:
        return cast("F", _without_vectorising(_numba.njit(function, **options)))
    before = _numba.config.CACHE_DIR
    _numba.config.CACHE_DIR = str(CACHE)
    try:
        compiled = _numba.njit(function, cache=True, **options)
    except RuntimeError:
        # A function that was typed in stands in no file whose changes could be seen.
        compiled = _numba.njit(function, **options)
    finally:
        _numba.config.CACHE_DIR = before
    _forgive(getattr(compiled, "_cache", None))
    return cast("F", _without_vectorising(compiled))


def _without_vectorising(compiled: Any) -> Any:
    """Let numba compile a function without turning its loops into vector loops.

    Loops over joints are short. A vector loop first checks that its arrays do not overlap, which
    takes longer than the loop itself: a tenth to a fifth of a step. numba knows this as a setting
    of a process, which is put back, as a user's own functions may want it.
    """
    compile_one = getattr(compiled, "compile", None)
    if compile_one is None:  # NUMBA_DISABLE_JIT: nothing is compiled
        return compiled

    def compile_scalar(signature: Any) -> Any:
        from numba.core.compiler_lock import global_compiler_lock

        with global_compiler_lock:
            before = _numba.config.LOOP_VECTORIZE
            _numba.config.LOOP_VECTORIZE = 0
            try:
                return compile_one(signature)
            finally:
                _numba.config.LOOP_VECTORIZE = before

    compiled.compile = compile_scalar
    return compiled


def _forgive(cache: Any) -> None:
    """Let a cache that cannot be read or written (a full disk) cost time and nothing else."""

    def forgiving(method: Callable[..., Any]) -> Callable[..., Any]:
        def attempt(*arguments: Any) -> Any:
            try:
                return method(*arguments)
            except Exception:  # whatever a broken file raises
                # Nothing could be written beside it either, in any later process.
                with contextlib.suppress(Exception):
                    cache.flush()
                return None

        return attempt

    for name in ("load_overload", "save_overload"):
        method = getattr(cache, name, None)
        if method is not None:
            setattr(cache, name, forgiving(method))
