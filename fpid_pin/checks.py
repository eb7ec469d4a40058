"""Shapes and ranges of what users pass in, checked once and named clearly.

Functions check arguments; the same checks are declared with a description's field,
``kp: Annotated[ArrayLike, PerJoint("N m/rad", low=0.0)]``; `fpid_pin.descriptions` applies them.
`checked` does the same for what a function's annotations say of its arguments.
"""

import difflib
import inspect
import math
import operator
import os
import re
import types
import typing
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cache, wraps
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fpid_pin.exceptions import ArgumentError as ArgumentError
from fpid_pin.text import cut, shown

T = TypeVar("T")
F = TypeVar("F", bound=Callable[..., Any])
FloatArray = NDArray[np.float64]
BoolArray = NDArray[np.bool_]
#: Sampling periods that a simulation can have [s], and the most rows: whole numbers are exact.
STEPS = (1e-9, 10.0)
MOST_ROWS = 1 << 53
#: Characters of a wrong choice: the nearest right one is to be read after it.
_SHORT = 40
#: What errors call classes that have no name of ours.
_WORDS_FOR: dict[Any, str] = {
    Callable: "a function", Mapping: "a dictionary", str: "a text", os.PathLike: "a path"
}  # fmt: skip
#: What is between the words of a name.
_WORDS = re.compile(r"[\W_]+")


def read_only(values: ArrayLike) -> FloatArray:
    """Return a C-ordered float64 copy of `values` that cannot be written to."""
    array = np.array(values, dtype=np.float64, order="C")
    array.flags.writeable = False
    return array


def _interval(low: float | None, high: float | None, above: float | None) -> str:
    start = "" if low is None else f"[{low:g}"
    start = start if above is None else f"({above:g}"
    if high is not None:
        return f"in {start}, {high:g}]" if start else f"<= {high:g}"
    return f"> {above:g}" if above is not None else f">= {low:g}" if start else "finite"


def floats(
    name: str,
    value: ArrayLike,
    *,
    low: float | None = None,
    high: float | None = None,
    above: float | None = None,
    finite: bool = True,
    max_ndim: int | None = None,
    shape: tuple[int | None, ...] | None = None,
) -> FloatArray:
    """Turn `value` into a read-only float64 array, and check every element.

    Booleans, texts and masked values are refused, NaN always, and inf unless it need not be
    `finite`. Bounds are ``low <= x <= high`` and ``x > above``; None in a `shape` is any length.
    An `ArgumentError` has the first element at fault, and what it is called: `name`.
    """
    wanted = "a number" if max_ndim == 0 else "numbers"
    try:
        raw = np.asarray(value)
    except (TypeError, ValueError):
        raise ArgumentError(name, wanted, shown(value)) from None
    if raw.dtype.kind not in "iuf" or raw.size == 0 or np.ma.is_masked(value):
        raise ArgumentError(name, wanted, shown(value))
    array = read_only(raw)
    if max_ndim is not None and array.ndim > max_ndim:
        expected = wanted if max_ndim == 0 else f"at most {max_ndim} dimension(s)"
        raise ArgumentError(name, expected, f"shape {array.shape}")
    if shape is not None and (
        array.ndim != len(shape)
        or any(k not in (None, n) for k, n in zip(shape, array.shape, strict=True))
    ):
        expected = f"shape {shape}".replace("None", "any")
        raise ArgumentError(name, expected, f"shape {array.shape}")
    bad = ~np.isfinite(array) if finite else np.isnan(array)
    for bound, is_beyond in ((low, np.less), (high, np.greater), (above, np.less_equal)):
        if bound is not None:
            bad |= is_beyond(array, bound)
    if bad.any():
        index = tuple(int(i) for i in np.argwhere(bad)[0])
        where = "".join(f".{i}" for i in index)
        expected = f"a number {_interval(low, high, above)}"
        raise ArgumentError(name + where, expected, f"{array[index]:g}")
    return array


def number(name: str, value: Any, **bounds: Any) -> float:
    """Check one real number, by the bounds of `floats`, and return it as a float."""
    return float(floats(name, value, max_ndim=0, **bounds))


def integer(name: str, value: Any, *, low: int | None = None, high: int | None = None) -> int:
    """Check one whole number and return it as an int."""
    try:
        if isinstance(value, (bool, np.bool_)):
            raise TypeError
        result = operator.index(value)
    except TypeError:
        raise ArgumentError(name, "a whole number", shown(value)) from None
    if not -(1 << 63) <= result < 1 << 64:
        raise ArgumentError(name, "a whole number of 64 bits", shown(result))
    if (low is not None and result < low) or (high is not None and result > high):
        raise ArgumentError(name, f"a whole number {_interval(low, high, None)}", shown(result))
    return result


def scalar_or_joints(name: str, value: ArrayLike, *, rows: int = 0, **bounds: Any) -> FloatArray:
    """Check a scalar for all joints or an array (n,), n not known yet; `rows`: also (rows, n)."""
    array = floats(name, value, max_ndim=2 if rows else 1, **bounds)
    if array.ndim == 2 and len(array) != rows:
        raise ArgumentError(name, f"shape (n,) or ({rows}, n)", f"shape {array.shape}")
    return array


def per_joint(name: str, value: ArrayLike, n: int, **bounds: Any) -> FloatArray:
    """Check a scalar or an (n,) array, by the bounds of `floats`; return a read-only (n,) array."""
    array = floats(name, value, **bounds)
    return vector(name, np.full(n, array) if array.ndim == 0 else array, n, finite=False)


def vector(name: str, value: ArrayLike, n: int, *, finite: bool = True) -> FloatArray:
    """Check an (n,) array of numbers (no broadcasting) and return a read-only copy."""
    array = floats(name, value, finite=finite)
    if array.shape != (n,):
        raise ArgumentError(name, f"shape ({n},) (the arm has {n} joints)", f"shape {array.shape}")
    return array


def times(name: str, value: ArrayLike) -> FloatArray:
    """Check two or more times that increase, (N,)."""
    array = floats(name, value, shape=(None,))
    if len(array) < 2:
        raise ArgumentError(name, "at least two times", f"shape {array.shape}")
    back = np.flatnonzero(np.diff(array) <= 0.0)
    if back.size:
        k = int(back[0]) + 1
        expected = f"a time after the one before ({array[k - 1]:g} s)"
        raise ArgumentError(f"{name}.{k}", expected, f"{array[k]:g} s")
    return array


def choice(name: str, value: Any, options: Iterable[str], among: str = "one of") -> str:
    """Check that `value` is among `options`; an error gives the nearest one."""
    known = list(options)
    if isinstance(value, str) and value in known:
        return value
    expected = cut(f"{among} " + ", ".join(known)) if known else "none"
    small = value.lower() if isinstance(value, str) else ""
    near = [option for option in known if option.lower() == small]
    # A word of a longer name, "fpid" of "adaptive_fpid", comes before what is written alike.
    near = near or [option for option in known if small and small in _WORDS.split(option.lower())]
    near = near or difflib.get_close_matches(small, known, n=1)
    hint = f" (did you mean {near[0]}?)" if near else ""
    raise ArgumentError(name, expected, f"{shown(value, _SHORT)}{hint}")


def instance(name: str, value: T, kind: type | tuple[type, ...], expected: str) -> T:
    """Check that `value` is an instance of `kind`; that it is no class is said in words."""
    if isinstance(value, type):
        raise ArgumentError(name, expected, f"the class {value.__name__}, not one that it makes")
    if not isinstance(value, kind):
        raise ArgumentError(name, expected, f"{type(value).__name__}")
    return value


def called(kind: type) -> str:
    """Return how an error names one of a kind: by the methods that it must have, if any will."""
    name = kind.__name__
    if getattr(kind, "_is_protocol", False):
        methods = [m for m, value in vars(kind).items() if m[0] != "_" and callable(value)]
        return f"a {name} (an object with {', '.join(methods)})"
    return _WORDS_FOR.get(kind, f"{'an' if name[0] in 'AEIOU' else 'a'} {name}")


def several(name: str, value: Any, kind: type[T], expected: str) -> list[T]:
    """Return one instance of `kind`, or several, as a list of them, each checked."""
    many = isinstance(value, Iterable) and not isinstance(value, (kind, type))
    items = list(value) if many and getattr(value, "shape", None) != () else [value]
    for item in items:
        instance(name, item, kind, expected)
    return items


def plain(name: str, value: Any, kind: type | tuple[type, ...], expected: str) -> Any:
    """Check that `value` is of one of some plain types; an error quotes it."""
    value = bool(value) if isinstance(value, np.bool_) else value
    if not isinstance(value, kind):
        raise ArgumentError(name, expected, shown(value))
    return value


def sampling_step(step: float) -> float:
    """Check a sampling period [s]."""
    number("step", step, above=0.0)
    return number("step", step, low=STEPS[0], high=STEPS[1])


def sample_count(duration: float, step: float) -> int:
    """Return the number of rows of a run, ``round(duration/step) + 1``: both ends count."""
    step = sampling_step(step)
    duration = number("duration", duration, above=0.0)
    if duration < step * (1.0 - 1e-9):
        raise ArgumentError("duration", f"at least one step ({step:g} s)", f"{duration:g} s")
    if duration > step * MOST_ROWS:
        raise ArgumentError("duration", f"at most {MOST_ROWS:.2g} steps ({step:g} s)", duration)
    return math.floor(duration / step + 0.5) + 1


# ---------------------------------------------------------------- declared with a field


@dataclass(frozen=True)
class Check:
    """A check declared with a field: ``check(name, value)`` returns the value as it is kept."""

    function: Callable[..., Any]  # called with name, value and bounds; it raises `ArgumentError`
    unit: str = ""  # of the field, for readers; empty: none
    bounds: Mapping[str, Any] = field(default_factory=dict)  # arguments of the function

    def __call__(self, name: str, value: Any) -> Any:
        """Return the value as the description keeps it."""
        return self.function(name, value, **self.bounds)


def _declare(function: Callable[..., Any]) -> Callable[..., Check]:
    return lambda unit="", **bounds: Check(function, unit, bounds)


#: Declare one real number, with the bounds of `floats`.
Number = _declare(number)
#: Declare a scalar for all joints, or (n,); with ``rows=3`` also (3, n).
PerJoint = _declare(scalar_or_joints)
#: Declare numbers of a ``shape=``, in which None is any length.
Array = _declare(floats)
#: Declare a whole number from ``low=`` to ``high=``.
Whole = _declare(integer)


def OneOf(*options: str) -> Check:
    """Declare one of several texts; beside another check, which is then for all else."""
    return Check(choice, bounds={"options": options})


def Plain(kind: type, expected: str) -> Check:
    """Declare a value of a plain type, called `expected`."""
    return Check(plain, bounds={"kind": kind, "expected": expected})


Flag = Plain(bool, "true or false")
Text = Plain(str, "a text")


# ---------------------------------------------------------------------- of arguments

#: How an argument is checked whose annotation is a plain type.
_PLAIN: dict[Any, Check] = {
    float: Number(finite=False), int: Whole(), bool: Flag, str: Text
}  # fmt: skip


def checked(function: F) -> F:
    """Refuse arguments that are not what a function's annotations say, before it begins.

    These are classes, paths, functions, single numbers and texts. What may be an array, or one or
    several, and what bounds there are, the function checks itself.
    """
    signature = inspect.signature(function)

    @wraps(function)
    def call(*args: Any, **kwargs: Any) -> Any:
        try:
            bound = signature.bind(*args, **kwargs)
        except TypeError:
            return function(*args, **kwargs)  # Python says what is missing, or one too many
        given = bound.arguments
        for name, (check, optional) in _declared(function).items():
            if name in given and not (optional and given[name] is None):
                given[name] = check(name, given[name])
        return function(*bound.args, **bound.kwargs)

    return cast("F", call)


@cache
def _declared(function: Callable[..., Any]) -> dict[str, tuple[Check, bool]]:
    """Return what checks a function's arguments, by name, and whether they may be None."""
    known, found = inspect.unwrap(function).__globals__, {}
    for name, annotation in inspect.get_annotations(function).items():
        one = types.SimpleNamespace(__annotations__={name: annotation})
        # What is imported for type checkers alone is not known, and not checked.
        with suppress(NameError):
            hint = typing.get_type_hints(one, known)[name]
            union = typing.get_origin(hint) in (typing.Union, types.UnionType)
            parts = typing.get_args(hint) if union else (hint,)
            kinds = {typing.get_origin(part) or part: None for part in parts}
            classes = tuple(os.PathLike if k is Path else k for k in kinds if k is not type(None))
            if len(classes) == 1 and classes[0] in _PLAIN:
                found[name] = _PLAIN[classes[0]], type(None) in kinds
            elif all(map(_is_class, classes)):
                named = [os.PathLike] if os.PathLike in classes else classes
                expected = " or ".join(map(called, named))
                check = Check(instance, bounds={"kind": classes, "expected": expected})
                found[name] = check, type(None) in kinds
    return found


def _is_class(kind: Any) -> bool:
    """Return whether one of a kind may be asked for: arrays, and several of a kind, are no such."""
    protocol = getattr(kind, "_is_protocol", False)
    return isinstance(kind, type) and not protocol and kind not in (Any, Sequence, Iterable)
