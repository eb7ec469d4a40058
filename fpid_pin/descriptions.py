"""Descriptions: frozen dataclasses whose fields are checked as declared, and their tables.

    @described("pulse", "Disturbance")
    @dataclass(frozen=True, eq=False)
    class Pulse(Description):
        torque: Annotated[ArrayLike, PerJoint("N m")]
        start: Annotated[float, Number("s")] = 0.0

An annotation says what a field must be; `keys` reads it once a class, for the constructor and for
tables alike. A field with no check, or a dataclass without `Description`, is taken as it is given.

The table of a description is ``{"kind": ..., field: value, ...}``: what is saved with a run and
written as TOML. Fields that are None are left out. Reading one back goes through the constructor,
so a file is checked exactly as an argument is, and nothing in it is ever executed.
"""

import dataclasses
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import MISSING, dataclass
from functools import cache
from typing import Any, ClassVar, TypeVar, cast

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import Check, Flag, Text, Whole
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.text import listing, shown

T = TypeVar("T")
D = TypeVar("D", bound=type)

_KINDS: dict[str, type] = {}
#: By class, and protocols by name: what a user calls a class of theirs is nobody's family.
_FAMILIES: dict[type | str, set[str]] = {}


def _number_or_joints(name: str, value: Any) -> Any:
    """Check a number, or one for each joint: a search finds such for a law's field that is one."""
    several = isinstance(value, (list, tuple))
    return (checks.scalar_or_joints if several else checks.number)(name, value, finite=False)


#: What a table's value must be where a field's type is all that is declared.
_PLAIN: dict[Any, Check] = {
    float: Check(_number_or_joints), int: Whole(), bool: Flag, str: Text
}  # fmt: skip


class Description:
    """What is described: a frozen dataclass whose constructor checks its fields as declared.

    What concerns several fields at once is checked in ``__post_init__``, after this one's.
    """

    #: What the names of its fields begin with in an error: ``plant.dry_friction``.
    _path: ClassVar[str] = ""
    #: The field that a plain value in its place is; such a one may also be given as a table.
    _short: ClassVar[str] = ""

    def __post_init__(self) -> None:
        first: tuple[str, int] | None = None
        for key in keys(cast("Any", type(self))).values():
            name, given = _join(self._path, key.name), getattr(self, key.name)
            value = key.checked(name, given)
            if value is not given:
                self._set(**{key.name: value})
            if key.is_per_joint and np.ndim(value):
                shape = np.shape(value)
                first = first or (key.name, shape[-1])
                if shape[-1] != first[1]:
                    expected = f"one length for all joints, ({first[1]},) as {first[0]}"
                    raise ArgumentError(name, expected, f"{shape}")

    def __str__(self) -> str:
        """Return a line for each field that is not as it is by default, with its unit."""
        known = keys(cast("Any", type(self)))
        values = without_defaults(type(self), vars(self)).items()
        rows = [(name, value, known[name].unit) for name, value in values]
        return listing(type(self).__name__, rows)

    def _set(self, **values: Any) -> None:
        """Complete fields while the description is made; it is frozen from then on."""
        for name, value in values.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Key:
    """A field of a description, as its annotation declares it: a key of its table."""

    name: str
    default: Any  # None where there is none
    required: bool  # whether there is no default
    checks: tuple[Check, ...]  # as declared: none, one, or a choice for texts and one for all else
    plain: Check | None  # of a table's value, by the field's plain type where none is declared
    family: type | None  # of the descriptions that it holds; None: it holds none
    several: type | None  # Sequence or Mapping where it holds many; a check is then for each
    optional: bool  # whether it may be None

    @property
    def unit(self) -> str:
        """Its unit; empty: none."""
        return next((check.unit for check in self.checks if check.unit), "")

    @property
    def is_per_joint(self) -> bool:
        """Whether it has a number for each joint."""
        return any(check.function is checks.scalar_or_joints for check in self.checks)

    def checked(self, name: str, value: Any, faults: list[FpidError] | None = None) -> Any:
        """Return a value as the description keeps it.

        With `faults` the value is a table's: descriptions in it are built, and what is wrong in
        them is appended there.
        """
        if value is None and self.optional:
            return None
        if self.family is not None:
            return self._members(name, value, faults)
        if self.plain is not None and faults is not None:
            return self.plain(name, value)
        for check in self.checks:
            # Of two, a choice is for texts and the other for all else.
            if len(self.checks) == 1 or isinstance(value, str) == (check.function is checks.choice):
                return check(name, value)
        return value

    def _members(self, name: str, value: Any, faults: list[FpidError] | None) -> Any:
        """Return what the field holds: one description, several of them, or some by name."""
        family = cast("type", self.family)

        def member(name: str, item: Any) -> Any:
            if isinstance(item, family):
                pass
            elif faults is not None:
                item = build(item, family, name, faults)
                if item is None:
                    return None
            elif getattr(family, "_short", "") and not isinstance(item, type):
                item = from_dict(item, family, name)
            checks.instance(name, item, family, checks.called(family) + " or None" * self.optional)
            try:
                for check in self.checks:
                    check(name, item)
            except ArgumentError as error:
                if faults is None:
                    raise
                faults.append(error)
            return item

        if self.several is Mapping:
            checks.plain(name, value, Mapping, "a table")
            return {key: member(_join(name, key), item) for key, item in value.items()}
        if self.several is Sequence:
            if faults is not None:
                checks.plain(name, value, (list, tuple), f"a list of tables ([[{name}]])")
            items = value if isinstance(value, (list, tuple)) else [value]
            return tuple(member(f"{name}.{k}", item) for k, item in enumerate(items))
        return member(name, value)


@cache
def keys(cls: type) -> Mapping[str, Key]:
    """Return the keys of a dataclass's table, by name, in the order of its fields."""
    hints: dict[str, Any] = {}
    for base in reversed(cls.__mro__):
        # A class may name what only its own function knows: its fields are taken as they are.
        with suppress(NameError):
            hints |= typing.get_type_hints(base, include_extras=True)
    return {
        field.name: _key(field, hints.get(field.name, Any))
        for field in dataclasses.fields(cls)
        if field.init
    }


def _key(field: dataclasses.Field[Any], hint: Any) -> Key:
    declared: tuple[Check, ...] = ()
    if typing.get_origin(hint) is typing.Annotated:
        hint, *extras = typing.get_args(hint)
        declared = tuple(extra for extra in extras if isinstance(extra, Check))
    parts = _types(hint)
    origins = [typing.get_origin(t) for t in (hint, *typing.get_args(hint))]
    default = field.default if field.default_factory is MISSING else field.default_factory()
    return Key(
        field.name,
        None if default is MISSING else default,
        default is MISSING,
        declared,
        None if declared else _PLAIN.get(hint),
        next((t for t in parts if isinstance(t, type) and _is_family(t)), None),
        next((t for t in (Sequence, Mapping) if t in origins), None),
        type(None) in parts,
    )


def without_defaults(cls: type, fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return a description's fields in plain values, without what is as it is by default."""
    kept = {}
    for key in keys(cls).values():
        value = _plain(fields.get(key.name, key.default))
        if key.required or value != _plain(key.default):
            kept[key.name] = value
    return kept


def _is_family(cls: type) -> bool:
    return issubclass(cls, Description) or hasattr(cls, "from_table") or bool(kinds(cls))


def _types(hint: Any) -> list[Any]:
    """Flatten unions, optional values and collections into the types that they are made of."""
    origin = typing.get_origin(hint)
    if origin in (typing.Union, types.UnionType, Sequence, Mapping):
        return [t for part in typing.get_args(hint) for t in _types(part)]
    return [origin or hint]


# ---------------------------------------------------------------------- kinds


def described(kind: str, *families: str) -> Callable[[D], D]:
    """Register a dataclass under the name that files use for it.

    `families` are protocols that it follows without being a subclass (``"Reference"``).
    """

    def register(cls: D) -> D:
        before = _KINDS.get(kind, cls)
        # A class written anew, in a notebook say, takes its own place.
        if (before.__module__, before.__qualname__) != (cls.__module__, cls.__qualname__):
            raise ArgumentError("kind", "a name that is not taken", f"{kind!r} ({before.__name__})")
        _KINDS[kind] = cls
        cls._kind = kind  # type: ignore[attr-defined]
        if families and issubclass(cls, Description):
            cls._path = families[0].lower()
        known: list[type | str] = [*cls.__mro__[:-1], *families]  # but for object
        for family in known:
            _FAMILIES.setdefault(family, set()).add(kind)
        return cls

    return register


def kinds(family: type) -> dict[str, type]:
    """Return the registered descriptions that belong to `family`, by kind."""
    found = set(_FAMILIES.get(family, ()))
    if getattr(family, "_is_protocol", False):
        found |= _FAMILIES.get(family.__name__, set())
    return {kind: _KINDS[kind] for kind in sorted(found)}


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
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    return to_dict(value)


# ---------------------------------------------------------------------- from a table


def from_dict(table: Any, family: Callable[..., T], name: str = "") -> T:
    """Build the description of a family that `table` holds, called `name` in errors.

    The first fault is raised: an unknown kind or key, or whatever a constructor refuses.
    """
    faults: list[FpidError] = []
    thing = build(table, cast("type", family), name, faults)
    if faults:
        raise faults[0]
    return cast("T", thing)


def build(table: Any, family: type, path: str, faults: list[FpidError]) -> Any:
    """Build the description that `table` holds, or None; every fault is appended to `faults`.

    A table may leave out its kind where the family has only one, has none where no name is
    registered, and may hold descriptions that are built already.
    """
    before, short = len(faults), getattr(family, "_short", "")
    if short and not isinstance(table, Mapping):
        table = {short: table}
    if not isinstance(table, Mapping):
        faults.append(ArgumentError(path or "description", "a table", shown(table)))
        return None
    known, cls, fields = kinds(family), family, dict(table)
    own = getattr(family, "from_table", None)
    if known:
        kind = fields.pop("kind", getattr(family, "_kind", None))
        try:
            cls = known[checks.choice(_join(path, "kind"), kind, known)]
        except ArgumentError as error:
            faults.append(error)
            return None
    if "variant" in fields and "kind" in {field.name for field in dataclasses.fields(cls)}:
        fields["kind"] = fields.pop("variant")
    if own is None:
        # A key at fault is left out, so that the constructor can find what else is wrong.
        fields = _read_fields(cls, fields, path, faults)
        if any(key.required and key.name not in fields for key in keys(cls).values()):
            return None
    try:
        thing = cls(**fields) if own is None else own(fields)
        return thing if len(faults) == before else None
    except ArgumentError as error:
        faults.append(ArgumentError(_rebase(error.name, path), error.expected, error.got))
    except FpidError as error:
        faults.append(type(error)(f"{path}: {error}" if path else str(error)))
    return None


def _read_fields(
    cls: type, table: Mapping[str, Any], path: str, faults: list[FpidError]
) -> dict[str, Any]:
    """Return the fields of a description that a table has right."""
    known, fields = keys(cls), {}
    for name in table:
        try:
            checks.choice(_join(path, name), name, known, among="one of the keys")
        except ArgumentError as error:
            faults.append(error)
    for name, key in known.items():
        before = len(faults)
        try:
            if name in table:
                fields[name] = key.checked(_join(path, name), table[name], faults)
            elif key.required:
                expected = "a table" if key.several is Mapping else "a value"
                raise ArgumentError(_join(path, name), expected, "none")
        except ArgumentError as error:
            faults.append(error)
        if len(faults) > before:
            fields.pop(name, None)
    return fields


def _join(path: str, key: str) -> str:
    key = key or '""'  # as TOML writes a name of no letters
    return f"{path}.{key}" if path else key


def _rebase(name: str, path: str) -> str:
    """Put an argument's name under its key path, without saying the table's name twice."""
    head, dot, rest = name.partition(".")
    parts = path.split(".")
    return _join(path, rest) if dot and head in parts else _join(path, name)
