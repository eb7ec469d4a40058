"""Changes to an arm that keep its geometry: payload, friction, limits, gravity, inertias.

Each is a small description with a table of its own, so that an arm in a saved run can be rebuilt:
its source, then its changes in the order in which they were made.
"""

from __future__ import annotations

import dataclasses
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.inertia import inertia_of, row_of, scaled_rows
from fpid_pin.arms.joints import placement_of
from fpid_pin.arms.spec import ArmSpec, gravity_vector
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

#: Of a limit in a file: inf is not a number in JSON.
_FAR = 1e9


class Change(ABC):
    """One alteration of an arm."""

    name: ClassVar[str]

    @abstractmethod
    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change, after checking that it fits."""

    def table(self) -> dict[str, Any]:
        """Return ``{name: {field: value}}`` with plain values; what is None is left out."""
        fields: dict[str, Any] = {}
        for item in dataclasses.fields(self):  # type: ignore[arg-type]
            value = getattr(self, item.name)
            if value is not None:
                fields[item.name] = value.tolist() if isinstance(value, np.ndarray) else value
        return {self.name: fields}


def from_table(table: Any, name: str = "changes") -> Change:
    """Build the change that ``{name: {field: value}}`` stands for.

    Raises
    ------
    ArgumentError
        An unknown change or field, or a value that it refuses.
    """
    known = {cls.name: cls for cls in _KINDS}
    if not isinstance(table, Mapping) or len(table) != 1:
        raise ArgumentError(name, "a table with one of " + ", ".join(known), shown(table))
    (key, fields) = next(iter(table.items()))
    cls = known[checks.choice(name, key, known)]
    if not isinstance(fields, Mapping):
        raise ArgumentError(f"{name}.{key}", "a table", shown(fields))
    for field in fields:
        checks.choice(f"key in {name}.{key}", field, [f.name for f in dataclasses.fields(cls)])
    try:
        return cls(**fields)
    except TypeError:
        required = [f.name for f in dataclasses.fields(cls) if f.default is dataclasses.MISSING]
        raise ArgumentError(f"{name}.{key}", "keys " + ", ".join(required), shown(fields)) from None


@dataclass(frozen=True, eq=False)
class Payload(Change):
    """A rigid body held at `frame`: `mass` [kg], centre of mass `com` [m] in that frame.

    `inertia` is its (3, 3) rotational inertia about its centre of mass [kg m^2]; None: a point.
    """

    mass: float
    com: ArrayLike = (0.0, 0.0, 0.0)
    frame: str | None = None
    inertia: ArrayLike | None = None

    name: ClassVar[str] = "payload"

    def __post_init__(self) -> None:
        object.__setattr__(self, "mass", checks.number("mass", self.mass, low=0.0))
        com = checks.floats("com", self.com)
        if com.shape != (3,):
            raise ArgumentError("com", "shape (3,)", f"shape {com.shape}")
        object.__setattr__(self, "com", com)
        if self.inertia is not None:
            inertia = checks.floats("inertia", self.inertia)
            if inertia.shape != (3, 3):
                raise ArgumentError("inertia", "shape (3, 3)", f"shape {inertia.shape}")
            if not np.array_equal(inertia, inertia.T):
                raise ArgumentError("inertia", "a symmetric matrix", inertia.tolist())
            moments = np.linalg.eigvalsh(inertia)
            if moments[0] < 0.0 or moments[:2].sum() < moments[2] * (1.0 - 1e-9):
                expected = "principal moments >= 0, none above the sum of the others"
                raise ArgumentError("inertia", expected, moments.tolist())
            object.__setattr__(self, "inertia", inertia)

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        frames = {joint.name: (k, None) for k, joint in enumerate(spec.joints)}
        frames |= {f.name: (f.joint, f.placement) for f in spec.frames}  # type: ignore[misc]
        name = checks.choice("frame", self.frame or spec.tool_frame, frames)
        joint, placement = frames[name]
        if joint < 0:
            raise ArgumentError("frame", "a frame that moves with the arm", shown(name))
        if self.mass == 0.0:
            return spec
        about_com = np.zeros((3, 3)) if self.inertia is None else np.array(self.inertia)
        body = pin.Inertia(self.mass, np.array(self.com), about_com)
        rows = spec.column("inertia")
        place = pin.SE3.Identity() if placement is None else placement_of(placement)
        rows[joint] = row_of(inertia_of(rows[joint]) + place.act(body))
        return spec.with_columns(inertia=rows)


@dataclass(frozen=True, eq=False)
class Friction(Change):
    """Viscous friction F_v [N m s/rad] and dry friction F_d [N m] per joint; None leaves it."""

    viscous: ArrayLike | None = None
    dry: ArrayLike | None = None

    name: ClassVar[str] = "friction"

    def __post_init__(self) -> None:
        for name in ("viscous", "dry"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, checks.floats(f"{name} friction", value, low=0.0))

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        return _with(spec, damping=("viscous friction", self.viscous),
                     friction=("dry friction", self.dry))  # fmt: skip


@dataclass(frozen=True, eq=False)
class Limits(Change):
    """Limits per joint; None leaves them.

    `effort` [N m] and `velocity` [rad/s]: 0 or inf is none. `lower` and `upper` [rad]: 1e9 and
    more is none.
    """

    effort: ArrayLike | None = None
    velocity: ArrayLike | None = None
    lower: ArrayLike | None = None
    upper: ArrayLike | None = None

    name: ClassVar[str] = "limits"

    def __post_init__(self) -> None:
        for name in ("effort", "velocity", "lower", "upper"):
            value = getattr(self, name)
            if value is not None:
                low = 0.0 if name in ("effort", "velocity") else None
                limit = np.array(checks.floats(f"{name} limit", value, low=low, finite=False))
                limit[(np.abs(limit) >= _FAR)] *= np.inf
                if low is not None:
                    limit[limit == 0.0] = np.inf
                object.__setattr__(self, name, checks.read_only(limit))

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        names = ("effort", "velocity", "lower", "upper")
        changed = _with(spec, **{name: (f"{name} limit", getattr(self, name)) for name in names})
        for joint in changed.joints:
            if not joint.lower < joint.upper:
                what = f"a number > {joint.lower:g} for {joint.name}"
                raise ArgumentError("upper limit", what, f"{joint.upper:g}")
        return changed

    def table(self) -> dict[str, Any]:
        """As elsewhere, but with a large number for "no limit": inf is not a number in JSON."""
        table = super().table()
        for name in table[self.name]:
            values = np.clip(np.asarray(getattr(self, name)), -_FAR, _FAR)
            table[self.name][name] = values.tolist()
        return table


@dataclass(frozen=True, eq=False)
class Gravity(Change):
    """Gravity [m/s^2]: a number (downwards) or (3,) in the world frame."""

    gravity: ArrayLike

    name: ClassVar[str] = "gravity"

    def __post_init__(self) -> None:
        object.__setattr__(self, "gravity", gravity_vector(self.gravity))

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        return dataclasses.replace(spec, gravity=tuple(np.asarray(self.gravity).tolist()))


@dataclass(frozen=True, eq=False)
class Armature(Change):
    """Rotor inertia seen at the joint [kg m^2], per joint; it replaces what there was."""

    armature: ArrayLike

    name: ClassVar[str] = "armature"

    def __post_init__(self) -> None:
        object.__setattr__(self, "armature", checks.floats("armature", self.armature, low=0.0))

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        return _with(spec, armature=("armature", self.armature))


@dataclass(frozen=True, eq=False)
class Inertias(Change):
    """Other inertias for all links, (n, 10).

    A row is mass, centre of mass (3) in the joint's frame and rotational inertia about it:
    xx, xy, yy, xz, yz, zz. These are Pinocchio's own numbers, so that nothing is rounded.
    """

    rows: ArrayLike

    name: ClassVar[str] = "inertias"

    def __post_init__(self) -> None:
        rows = checks.floats("inertias", self.rows)
        if rows.ndim != 2 or rows.shape[1] != 10:
            raise ArgumentError("inertias", "shape (n, 10)", f"shape {rows.shape}")
        object.__setattr__(self, "rows", rows)

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        rows, n = np.asarray(self.rows), len(spec.joints)
        if rows.shape[0] != n:
            raise ArgumentError("inertias", f"shape ({n}, 10)", f"shape {rows.shape}")
        return spec.with_columns(inertia=rows)


@dataclass(frozen=True, eq=False)
class ScaledLinks(Change):
    """Links' densities times `mass`, and their rotational inertias times `inertia` again.

    Factors > 0, a scalar or (n,). Centres of mass stay, and so does physical consistency.
    """

    mass: ArrayLike = 1.0
    inertia: ArrayLike = 1.0

    name: ClassVar[str] = "scaled_links"

    def __post_init__(self) -> None:
        for name in ("mass", "inertia"):
            factor = checks.floats(name, getattr(self, name), above=0.0, max_ndim=1)
            object.__setattr__(self, name, factor)

    def apply(self, spec: ArmSpec) -> ArmSpec:
        """Return the arm with the change."""
        n = len(spec.joints)
        mass, inertia = (checks.per_joint(k, getattr(self, k), n) for k in ("mass", "inertia"))
        return spec.with_columns(inertia=scaled_rows(spec.column("inertia"), mass, inertia))


def _with(spec: ArmSpec, **columns: tuple[str, Any]) -> ArmSpec:
    """Return the arm with other numbers in fields of its joints: (name, scalar or (n,) or None)."""
    n = len(spec.joints)
    given = {
        key: checks.per_joint(name, value, n, finite=False)
        for key, (name, value) in columns.items() if value is not None
    }  # fmt: skip
    return spec.with_columns(**given) if given else spec


_KINDS = (Payload, Friction, Limits, Gravity, Armature, Inertias, ScaledLinks)
