"""Arms made from other arms: payload, friction, limits, gravity, inertias."""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.chain import column, gravity_vector, set_columns
from fpid_pin.arms.inertia import impossible, row_of
from fpid_pin.arms.rigid_body import RigidBody
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

T = TypeVar("T")
#: A limit that is none, in a file: inf is not a number in JSON.
_FAR = 1e9


@dataclass(frozen=True, eq=False, repr=False)
class ArmChanges(RigidBody):
    """What makes another arm of an arm; ``with_NAME`` is the change NAME of a file's table."""

    _changes: tuple[Mapping[str, Any], ...] = ()

    def _changed(self, name: str, fields: Mapping[str, Any], **columns: Any) -> Self:
        """Return the arm with other numbers of its joints; `fields` are the table of the change."""
        model = self.model.copy()
        set_columns(model, **columns)
        table = {
            key: value.tolist() if isinstance(value, np.ndarray) else value
            for key, value in fields.items()
            if value is not None
        }
        return dataclasses.replace(self, model=model, _changes=(*self._changes, {name: table}))

    def with_payload(
        self,
        mass: float,
        com: ArrayLike = (0.0, 0.0, 0.0),
        frame: str | None = None,
        inertia: ArrayLike | None = None,
    ) -> Self:
        """Return the arm holding a body, `mass` [kg], at `com` [m] of `frame` (None: the tool's).

        `inertia` is the body's (3, 3) rotational inertia about its centre of mass [kg m^2]; None: a
        point.
        """
        mass = checks.number("mass", mass, low=0.0)
        centre = checks.floats("com", com, shape=(3,))
        given = None if inertia is None else checks.floats("inertia", inertia, shape=(3, 3))
        about = np.zeros((3, 3)) if given is None else np.array(given)
        body = pin.Inertia(mass, np.array(centre), np.zeros((3, 3)))
        body.inertia = about
        if not np.array_equal(about, about.T):
            raise ArgumentError("inertia", "a symmetric matrix", about.tolist())
        if impossible(np.array([row_of(body)]), rounding=1e-9)[0]:
            expected = "principal moments >= 0, none above the sum of the others"
            raise ArgumentError("inertia", expected, np.linalg.eigvalsh(about).tolist())
        # A joint's own frame is where its link begins.
        places = {str(place.name): place for place in list(self.model.frames)[1:]}
        name = checks.choice("frame", frame or self.tool, places)
        joint = int(places[name].parentJoint)
        if joint == 0:
            raise ArgumentError("frame", "a frame that moves with the arm", shown(name))
        rows = column(self.model, "inertia")
        if mass > 0.0:
            rows[joint - 1] = row_of(self.model.inertias[joint] + places[name].placement.act(body))
        fields = {"mass": mass, "com": centre, "frame": frame, "inertia": given}
        return self._changed("payload", fields, inertia=rows)

    def with_friction(self, viscous: ArrayLike | None = None, dry: ArrayLike | None = None) -> Self:
        """Return the arm with other F_v [N m s/rad] or F_d [N m]; what is None stays."""
        given = {"viscous friction": viscous, "dry friction": dry}
        columns = self._columns(given, ("damping", "friction"), low=0.0)
        fields = {"viscous": columns.get("damping"), "dry": columns.get("friction")}
        return self._changed("friction", fields, **columns)

    def with_limits(
        self,
        effort: ArrayLike | None = None,
        velocity: ArrayLike | None = None,
        lower: ArrayLike | None = None,
        upper: ArrayLike | None = None,
    ) -> Self:
        """Return the arm with other limits; what is None stays.

        `effort` [N m] and `velocity` [rad/s]: 0 or inf is none; `lower` and `upper` [rad]: -inf or
        inf is none. Home moves into them.
        """
        rates = {"effort limit": effort, "velocity limit": velocity}
        columns = self._columns(rates, ("effort", "velocity"), low=0.0)
        columns = {key: np.where(limit > 0.0, limit, np.inf) for key, limit in columns.items()}
        bounds = {"lower limit": lower, "upper limit": upper}
        columns |= self._columns(bounds, ("lower", "upper"))
        columns = {
            key: np.where(np.abs(limit) < _FAR, limit, np.copysign(np.inf, limit))
            for key, limit in columns.items()
        }
        written = {key: np.clip(limit, -_FAR, _FAR) for key, limit in columns.items()}
        arm = self._changed("limits", written, **columns)
        low, high = column(arm.model, "lower"), column(arm.model, "upper")
        for k in np.flatnonzero(~(low < high)):
            what = f"a number > {low[k]:g} for {self.joint_names[k]}"
            raise ArgumentError("upper limit", what, f"{high[k]:g}")
        return arm

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """Return the arm under another gravity [m/s^2]: a number (along -z) or (3,)."""
        vector = gravity_vector("gravity", gravity)
        arm = self._changed("gravity", {"gravity": vector})
        arm.model.gravity.linear = np.array(vector)
        return arm

    def with_armature(self, armature: ArrayLike) -> Self:
        """Return the arm with other rotor inertias [kg m^2], seen at the joint."""
        columns = self._columns({"armature": armature}, ("armature",), low=0.0)
        return self._changed("armature", columns, **columns)

    def with_inertias(self, rows: ArrayLike) -> Self:
        """Return the arm with other inertias for all links, (n, 10).

        A row is mass, centre of mass (3) in the joint's frame and rotational inertia about it: xx,
        xy, yy, xz, yz, zz. These are Pinocchio's own numbers, so that nothing is rounded.
        """
        numbers = checks.floats("inertias", rows, shape=(self.n, 10))
        return self._changed("inertias", {"rows": numbers}, inertia=numbers)

    def with_scaled_links(self, mass: ArrayLike = 1.0, inertia: ArrayLike = 1.0) -> Self:
        """Return the arm with heavier or lighter links, each by a factor > 0, a scalar or (n,).

        `mass` scales a link's density, and with it its rotational inertia, which `inertia` scales
        further. Centres of mass stay; what is made is physically consistent if this arm is.
        """
        factors = self._columns({"mass": mass, "inertia": inertia}, ("mass", "inertia"), above=0.0)
        return self._changed("scaled_links", factors, inertia=self._scaled(**factors))

    def _scaled(self, mass: Any, inertia: Any) -> Any:
        """Return the links' inertias, (n, 10), their density and then their shape times (n,)."""
        rows = column(self.model, "inertia")
        rows[:, 0] *= mass
        rows[:, 4:] *= np.multiply(mass, inertia)[:, np.newaxis]
        return rows

    def with_changes(self, *tables: Mapping[str, Any]) -> Self:
        """Return the arm with changes as files have them, ``{"payload": {"mass": 1.0}}``, in order.

        Raises
        ------
        ArgumentError
            An unknown change or field, or a value that it refuses.
        """
        arm = self
        for k, table in enumerate(tables):
            if not isinstance(table, Mapping) or len(table) != 1:
                raise ArgumentError(f"changes.{k}", "a table with one change", shown(table))
            ((name, fields),) = table.items()
            checks.choice(f"changes.{k}", name, _NAMES)
            checks.instance(f"changes.{k}.{name}", fields, Mapping, "a table")
            arm = call(getattr(arm, f"with_{name}"), fields, f"changes.{k}.{name}")
        return arm

    def perturbed(
        self,
        rng: np.random.Generator,
        mass: float = 0.2,
        com: float = 0.0,
        inertia: float = 0.0,
        friction: float = 0.0,
    ) -> Self:
        """Return an arm whose true parameters differ from this one's, at random.

        Parameters
        ----------
        rng
            Where chance comes from; the same state gives the same arm.
        mass
            Relative spread of each link's mass (and of its rotational inertia with it), in [0, 1).
        com
            Each centre of mass moves by up to this much along each axis [m].
        inertia
            Further relative spread of the rotational inertia about the centre of mass, in [0, 1).
        friction
            Relative spread of F_v and F_d per joint, in [0, 1].

        Notes
        -----
        All spreads are uniform. Whatever is drawn is physically consistent if this arm is: a mass
        and its rotational inertia are scaled together (the density changes, not the shape).
        """
        checks.instance("rng", rng, np.random.Generator, "a numpy.random.Generator")
        for name, value in (("mass", mass), ("inertia", inertia), ("friction", friction)):
            checks.number(name, value, low=0.0, high=1.0 if name == "friction" else 1.0 - 1e-9)
        checks.number("com", com, low=0.0)
        density = rng.uniform(1.0 - mass, 1.0 + mass, self.n)
        shift = rng.uniform(-com, com, (self.n, 3))
        rows = self._scaled(density, rng.uniform(1.0 - inertia, 1.0 + inertia, self.n))
        rows[:, 1:4] += shift
        arm = self.with_inertias(rows)
        if friction:
            scale = rng.uniform(1.0 - friction, 1.0 + friction, (2, self.n))
            viscous, dry = scale * [column(self.model, key) for key in ("damping", "friction")]
            arm = arm.with_friction(viscous, dry)
        return arm

    def _columns(
        self,
        given: Mapping[str, Any],
        keys: tuple[str, ...],
        low: float | None = None,
        above: float | None = None,
    ) -> dict[str, Any]:
        """Return what is given, by its name in a message, as (n,) by these keys."""
        n, finite = self.n, not any("limit" in name for name in given)
        return {
            key: checks.per_joint(name, value, n, low=low, above=above, finite=finite)
            for key, (name, value) in zip(keys, given.items(), strict=True)
            if value is not None
        }


#: Changes of a file's table; the keys of each are the method's arguments.
_NAMES = ("payload", "friction", "limits", "gravity", "armature", "inertias", "scaled_links")


def call(make: Callable[..., T], fields: Mapping[str, Any], where: str, of: Any = None) -> T:
    """Call `make` with the keys of a table, which are its arguments, or those of `of`."""
    known = inspect.signature(of or make).parameters
    for key in fields:
        checks.choice(f"{where}.{key}", key, known, among="one of the keys")
    for key, parameter in known.items():
        if parameter.default is parameter.empty and key not in fields:
            raise ArgumentError(f"{where}.{key}", "a value", "none")
    return make(**fields)
