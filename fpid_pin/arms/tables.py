"""How files name arms: the kinds of an ``[arm]`` table, with the arguments of `Arm`'s constructors.

    {"kind": "two_link"}
    {"kind": "planar", "lengths": [1.0, 0.8], "masses": [1.0, 1.0]}
    {"kind": "urdf", "path": "my_arm.urdf"}          # or "urdf": the text itself
    {"kind": "mjcf", "path": "my_arm.xml"}
    {"kind": "example", "name": "ur5"}
    {"kind": "description", "name": "ur5e_description"}
    {"kind": "model", "name": "gantry", "joints": [{...}, ...]}

and in each of them ``"changes"``: a list of ``{"payload": {...}}``, ``{"friction": {...}}``,
``{"limits": {...}}``, ``{"gravity": {...}}``, ``{"armature": {...}}``, ``{"inertias": {...}}``.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from typing import Any

from fpid_pin import checks
from fpid_pin.arms.arm import Arm
from fpid_pin.arms.spec import ArmSpec
from fpid_pin.arms.tree import HoldError
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown


def _urdf(urdf: str | None = None, **fields: Any) -> Arm:
    """Read a URDF by its path, or by its text, of which `path` says where its meshes are."""
    if urdf is None:
        if "path" not in fields:
            raise ArgumentError("arm.path", "a URDF file", "none")
        return Arm.from_urdf(**fields)
    checks.instance("urdf", urdf, str, "the text of a URDF")
    path = fields.get("path", "")
    if not isinstance(path, str) or "\0" in path:
        raise ArgumentError("path", "the path of a URDF file", shown(path))
    return Arm._from_urdf_text(urdf, **fields)


def _model(**fields: Any) -> Arm:
    return Arm._assembled(ArmSpec.from_table(fields))


#: Of each kind, what makes the arm, and what has its keys as arguments.
_KINDS: dict[str, tuple[Callable[..., Arm], Callable[..., Any]]] = {
    "two_link": (Arm.two_link, Arm.two_link),
    "planar": (Arm.planar, Arm.planar),
    "urdf": (_urdf, Arm.from_urdf),
    "mjcf": (Arm.from_mjcf, Arm.from_mjcf),
    "example": (Arm.from_example, Arm.from_example),
    "description": (Arm.from_description, Arm.from_description),
    "model": (_model, ArmSpec),
}


def arm_of(table: Mapping[str, Any]) -> Arm:
    """Build the arm of a table; raises `ArgumentError` for an unknown or missing key."""
    kind = checks.choice("kind", table.get("kind"), _KINDS)
    fields = {key: value for key, value in table.items() if key != "kind"}
    make, signed = _KINDS[kind]
    keys = inspect.signature(signed).parameters
    known = [*keys, *(["urdf"] if kind == "urdf" else []), "changes"]
    for key in fields:
        checks.choice(key, key, known)
    for key, parameter in keys.items():
        if parameter.default is parameter.empty and key not in fields and kind != "urdf":
            raise ArgumentError(f"arm.{key}", "a value", "none")
    changes = fields.get("changes", [])
    checks.instance("changes", changes, (list, tuple), "a list of tables")
    arm = make(**{key: value for key, value in fields.items() if key != "changes"})
    return arm.with_changes(*changes)


def _from_table(kind: str, fields: Mapping[str, Any]) -> Arm:
    try:
        return arm_of({"kind": kind, **fields})
    except HoldError as error:
        raise error.in_toml() from None


for _kind in _KINDS:
    # Reading one gives an `Arm`; none of these classes ever has an instance.
    described(_kind)(
        type(f"_{_kind}", (Arm,), {
            "from_table": classmethod(lambda cls, fields, kind=_kind: _from_table(kind, fields)),
        })
    )  # fmt: skip
