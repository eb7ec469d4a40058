"""How files name arms: the kinds of an ``[arm]`` table, each read back through its source.

    {"kind": "two_link"}
    {"kind": "planar", "lengths": [1.0, 0.8], "masses": [1.0, 1.0]}
    {"kind": "urdf", "path": "my_arm.urdf"}          # or "urdf": the text itself
    {"kind": "mjcf", "path": "my_arm.xml"}           # "sdf" likewise
    {"kind": "example", "name": "ur5"}
    {"kind": "description", "name": "ur5e_description"}
    {"kind": "model", "name": "gantry", "joints": [{...}, ...]}

and in each of them ``"changes"``: a list of ``{"payload": {...}}``, ``{"friction": {...}}``,
``{"limits": {...}}``, ``{"gravity": {...}}``, ``{"armature": {...}}``, ``{"inertias": {...}}``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from fpid_pin import checks
from fpid_pin.arms import change
from fpid_pin.arms.arm import Arm, assemble
from fpid_pin.arms.catalogue import ExampleSource
from fpid_pin.arms.mjcf import read_mjcf
from fpid_pin.arms.model import ModelSource
from fpid_pin.arms.planar import PlanarSource
from fpid_pin.arms.robot_descriptions import read_description
from fpid_pin.arms.sdf import read_sdf
from fpid_pin.arms.source import Source
from fpid_pin.arms.two_link import TwoLinkSource
from fpid_pin.arms.urdf import UrdfSource
from fpid_pin.arms.xml_text import read_text
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown


class _Table(Arm):
    """A kind of arm in a file. Reading one gives an `Arm`; none of these is ever an instance."""

    #: Keys of the table: required, then optional.
    _required: tuple[str, ...] = ()
    _optional: tuple[str, ...] = ()

    @classmethod
    def from_table(cls, fields: Mapping[str, Any]) -> Arm:
        """Build the arm; raises `ArgumentError` for an unknown or missing key."""
        known = (*cls._required, *cls._optional, "changes")
        for key in fields:
            checks.choice(key, key, known)
        for key in cls._required:
            if key not in fields:
                raise ArgumentError(f"arm.{key}", "a value", "none")
        rest = {key: value for key, value in fields.items() if key != "changes"}
        changes = fields.get("changes", [])
        if not isinstance(changes, (list, tuple)):
            raise ArgumentError("changes", "a list of tables", shown(changes))
        items = [change.from_table(item, f"changes.{k}") for k, item in enumerate(changes)]
        return assemble(cls._source_of(rest), items)

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        raise NotImplementedError


@described("two_link")
class _TwoLink(_Table):
    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return TwoLinkSource()


@described("planar")
class _Planar(_Table):
    _required = ("lengths", "masses")
    _optional = ("gravity", "rods")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return PlanarSource(**fields)


@described("urdf")
class _Urdf(_Table):
    _optional = ("urdf", "path", "lock", "gravity", "package_dirs")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        if "urdf" not in fields:
            if "path" not in fields:
                raise ArgumentError("arm.path", "a URDF file", "none")
            fields["urdf"] = read_text(fields["path"])
        return UrdfSource(fields.pop("urdf"), **fields)


@described("example")
class _Example(_Table):
    _required = ("name",)
    _optional = ("lock",)

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return ExampleSource(**fields)


@described("mjcf")
class _Mjcf(_Table):
    _required = ("path",)
    _optional = ("lock", "gravity")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return read_mjcf(fields["path"], fields.get("lock"), fields.get("gravity"))


@described("sdf")
class _Sdf(_Table):
    _required = ("path",)
    _optional = ("lock", "gravity")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return read_sdf(fields["path"], fields.get("lock"), fields.get("gravity"))


@described("description")
class _Description(_Table):
    _required = ("name",)
    _optional = ("lock", "gravity")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return read_description(fields["name"], fields.get("lock"), fields.get("gravity"))


@described("model")
class _Model(_Table):
    _required = ("joints",)
    _optional = ("frames", "shapes", "name", "gravity", "home", "tool")

    @classmethod
    def _source_of(cls, fields: dict[str, Any]) -> Source:
        return ModelSource(**fields)
