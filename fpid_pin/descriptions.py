"""Descriptions as plain tables: what is saved with a run and written as TOML.

A description (controller, reference, plant, ...) is a frozen dataclass whose fields are numbers,
arrays, strings and other descriptions. Its table is ``{"kind": ..., field: value, ...}``; fields
that are None are left out. Reading one back goes through its constructor, so a file is checked
exactly as an argument is, and nothing in it is ever executed.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from typing import Any, TypeVar, cast

import numpy as np

from fpid_pin import checks
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.text import shown

T = TypeVar("T")
D = TypeVar("D", bound=type)

_KINDS: dict[str, type] = {}
_FAMILIES: dict[str, set[str]] = {}


def described(kind: str, *families: str) -> Callable[[D], D]:
    """Register a dataclass under the name that files use for it.

    Parameters
    ----------
    kind
        The name.
    families
        Names of protocols that it follows without being a subclass (``"Reference"``).
    """

    def register(cls: D) -> D:
        before = _KINDS.get(kind, cls)
        # A class written anew, in a notebook say, takes its own place.
        if (before.__module__, before.__qualname__) != (cls.__module__, cls.__qualname__):
            raise ArgumentError("kind", "a name that is not taken", f"{kind!r} ({before.__name__})")
        _KINDS[kind] = cls
        cls._kind = kind  # type: ignore[attr-defined]
        for name in {base.__name__ for base in cls.__mro__} | set(families):
            _FAMILIES.setdefault(name, set()).add(kind)
        return cls

    return register


def kinds(family: type) -> dict[str, type]:
    """Return the registered descriptions that belong to `family`, by kind."""
    return {kind: _KINDS[kind] for kind in sorted(_FAMILIES.get(family.__name__, ()))}


# ---------------------------------------------------------------------- to a table


def to_dict(thing: Any) -> dict[str, Any]:
    """Return the table of a description: plain numbers, strings, lists and tables.

    A class may define ``to_dict`` itself. Objects of a user's own that are not registered become
    ``{"kind": "custom", "repr": ...}``, which cannot be read back.
    """
    own = getattr(thing, "to_dict", None)
    if callable(own):
        return cast("dict[str, Any]", own())
    kind = getattr(type(thing), "_kind", None)
    if kind is None or not dataclasses.is_dataclass(thing):
        return {"kind": "custom", "repr": repr(thing)}
    table: dict[str, Any] = {"kind": kind}
    for field in dataclasses.fields(thing):
        value = getattr(thing, field.name)
        if field.init and value is not None:
            # A field "kind" would hide the description's own.
            table["variant" if field.name == "kind" else field.name] = _plain(value)
    return table


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items() if item is not None}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, (bool, int, float, str)):
        return value
    return to_dict(value)


# ---------------------------------------------------------------------- from a table


def from_dict(table: Any, family: Callable[..., T], name: str = "") -> T:
    """Build the description that `table` holds.

    Parameters
    ----------
    table
        What `to_dict` returned, perhaps by way of a file.
    family
        The class that the result must belong to.
    name
        Key path, for errors.

    Raises
    ------
    FpidError
        The first fault: an unknown kind or key, or whatever a constructor refuses.
    """
    faults: list[FpidError] = []
    thing = build(table, cast("type", family), name, faults)
    if faults:
        raise faults[0]
    return cast("T", thing)


def build(table: Any, family: type, path: str, faults: list[FpidError]) -> Any:
    """Build the description that `table` holds, or None; every fault is appended to `faults`.

    A table may leave out its kind where the family has only one.
    """
    before = len(faults)
    if not isinstance(table, Mapping):
        faults.append(ArgumentError(path or "description", "a table", shown(table)))
        return None
    known = kinds(family)
    only = getattr(family, "_kind", None)
    try:
        kind = checks.choice(_join(path, "kind"), table.get("kind", only), known)
    except ArgumentError as error:
        faults.append(error)
        return None
    cls = known[kind]
    fields = {key: value for key, value in table.items() if key != "kind"}
    if "variant" in fields and "kind" in {field.name for field in dataclasses.fields(cls)}:
        fields["kind"] = fields.pop("variant")
    own = getattr(cls, "from_table", None)
    if own is None:
        # A key at fault is left out, so that the constructor can find what else is wrong.
        for key in _check_fields(cls, fields, path, faults):
            fields.pop(key, None)
        for key, member in _members(cls).items():
            if key in fields:
                count = len(faults)
                fields[key] = _build_member(fields[key], member, _join(path, key), faults)
                if len(faults) > count:
                    fields.pop(key)
        if not _required(cls) <= fields.keys():
            return None
    try:
        thing = cls(**fields) if own is None else own(fields)
        return thing if len(faults) == before else None
    except ArgumentError as error:
        faults.append(ArgumentError(_rebase(error.name, path), error.expected, error.got))
    except FpidError as error:
        faults.append(type(error)(f"{path}: {error}" if path else str(error)))
    return None


def _build_member(value: Any, family: type, path: str, faults: list[FpidError]) -> Any:
    if isinstance(value, (list, tuple)):
        return [build(v, family, _join(path, str(k)), faults) for k, v in enumerate(value)]
    return build(value, family, path, faults)


def _join(path: str, key: str) -> str:
    return f"{path}.{key}" if path else key


def _rebase(name: str, path: str) -> str:
    """Put an argument's name under its key path, without saying the table's name twice."""
    head, dot, rest = name.partition(".")
    parts = path.split(".")
    return _join(path, rest) if dot and head in parts else _join(path, name)


def _types(hint: Any) -> list[Any]:
    """Flatten unions, optional values and sequences into the types that they are made of."""
    origin = typing.get_origin(hint)
    if origin is None:
        return [hint]
    if origin in (typing.Union, types.UnionType) or (
        isinstance(origin, type) and issubclass(origin, (list, tuple, Sequence))
    ):
        return [t for part in typing.get_args(hint) for t in _types(part)]
    return [origin]


@cache
def _members(cls: type) -> dict[str, type]:
    """Return the fields of a description that hold other descriptions, and their families."""
    hints = typing.get_type_hints(cls)
    found = {}
    for field in dataclasses.fields(cls):
        for hint in _types(hints[field.name]):
            if isinstance(hint, type) and hint.__name__ in _FAMILIES and hint is not object:
                found[field.name] = hint
    return found


@cache
def _required(cls: type) -> frozenset[str]:
    """Return the fields of a description that have no default."""
    return frozenset(
        field.name
        for field in dataclasses.fields(cls)
        if field.init
        and field.default is dataclasses.MISSING
        and field.default_factory is dataclasses.MISSING
    )


@cache
def _model(cls: type) -> Any:
    """Return the pydantic model of a table's keys: which there are, and which plain types."""
    import pydantic

    plain = {float: pydantic.StrictFloat | pydantic.StrictInt, int: pydantic.StrictInt,
             str: pydantic.StrictStr, bool: pydantic.StrictBool}  # fmt: skip
    hints = typing.get_type_hints(cls)
    members = _members(cls)
    keys: dict[str, Any] = {}
    for field in dataclasses.fields(cls):
        if not field.init:
            continue
        hint = hints[field.name]
        kind = plain.get(hint, Any) if field.name not in members else Any
        keys[field.name] = (kind, ... if field.name in _required(cls) else None)
    config = pydantic.ConfigDict(extra="forbid", protected_namespaces=())
    return pydantic.create_model(cls.__name__, __config__=config, **keys)


_EXPECTED = {"string_type": "a text", "int_type": "a whole number", "bool_type": "true or false"}


def _check_fields(
    cls: type, fields: Mapping[str, Any], path: str, faults: list[FpidError]
) -> set[str]:
    """Append what is unknown, missing or of the wrong plain type, and return those keys."""
    import pydantic

    seen: set[str] = set()
    try:
        _model(cls)(**fields)
    except pydantic.ValidationError as error:
        for fault in error.errors(include_url=False):
            key = str(fault["loc"][0])
            if key in seen:
                # One line a key: a union reports each of its branches.
                continue
            seen.add(key)
            if fault["type"] == "extra_forbidden":
                allowed = [f.name for f in dataclasses.fields(cls) if f.init]
                try:
                    checks.choice(_join(path, key), key, allowed)
                except ArgumentError as unknown:
                    expected = unknown.expected.replace("one of", "one of the keys", 1)
                    faults.append(ArgumentError(_join(path, key), expected, unknown.got))
            elif fault["type"] == "missing":
                faults.append(ArgumentError(_join(path, key), "a value", "none"))
            else:
                expected = _EXPECTED.get(fault["type"], "a number")
                faults.append(ArgumentError(_join(path, key), expected, shown(fault["input"])))
    return seen
