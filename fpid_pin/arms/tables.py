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


def _model(**fields: Any) -> Arm:
    return Arm._assembled(ArmSpec.from_table(fields))


#: Of each kind, what makes the arm, and what has its keys as arguments.
_KINDS: dict[str, tuple[Callable[..., Arm], Callable[..., Any]]] = {
    "two_link": (Arm.two_link, Arm.two_link),
    "planar": (Arm.planar, Arm.planar),
    "urdf": (Arm.from_urdf, Arm.from_urdf),
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
    for key in fields:
        checks.choice(key, key, [*keys, "changes"])
    for key, parameter in keys.items():
        if parameter.default is parameter.empty and key not in fields:
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
