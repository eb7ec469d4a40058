"""How files name arms: the kinds of an ``[arm]`` table, with the arguments of `Arm`'s constructors.

    {"kind": "two_link"}
    {"kind": "planar", "lengths": [1.0, 0.8], "masses": [1.0, 1.0]}
    {"kind": "urdf", "path": "my_arm.urdf"}          # or "urdf": the text itself
    {"kind": "mjcf", "path": "my_arm.xml"}
    {"kind": "example", "name": "ur5"}
    {"kind": "description", "name": "ur5e_description"}
    {"kind": "model", "name": "gantry", "joints": [{...}, ...]}

and in each of them ``"changes"``: a list of what `Arm.with_changes` takes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from fpid_pin import checks, descriptions
from fpid_pin.arms.arm import Arm
from fpid_pin.arms.chain import Chain
from fpid_pin.arms.changes import call
from fpid_pin.arms.tree import HoldError


def _model(**fields: Any) -> Arm:
    return Arm._of(descriptions.from_dict(fields, Chain))


#: By the kind of an ``[arm]`` table, what makes the arm; its arguments are the table's keys. Each
#: may have ``changes``, a list of what `Arm.with_changes` takes.
_KINDS: dict[str, Callable[..., Arm]] = {
    "two_link": Arm.two_link,
    "planar": Arm.planar,
    "urdf": Arm.from_urdf,
    "mjcf": Arm.from_mjcf,
    "example": Arm.from_example,
    "description": Arm.from_description,
    "model": _model,
}


def arm_of(table: Mapping[str, Any]) -> Arm:
    """Build the arm of a table; raises `ArgumentError` for an unknown or missing key."""
    kind = checks.choice("kind", table.get("kind"), _KINDS)
    changes = table.get("changes", ())
    checks.instance("changes", changes, (list, tuple), "a list of tables")
    fields = {key: value for key, value in table.items() if key not in ("kind", "changes")}
    arm = call(_KINDS[kind], fields, "arm", of=Chain if kind == "model" else None)
    return arm.with_changes(*changes)


def _from_table(kind: str, fields: Mapping[str, Any]) -> Arm:
    try:
        return arm_of({"kind": kind, **fields})
    except HoldError as error:
        raise error.written("toml") from None


for _kind in _KINDS:
    # Reading one gives an `Arm`; none of these classes ever has an instance.
    descriptions.described(_kind)(
        type(f"_{_kind}", (Arm,), {
            "from_table": classmethod(lambda cls, fields, kind=_kind: _from_table(kind, fields)),
        })
    )  # fmt: skip
