"""Arms made from other arms: payload, friction, limits, gravity, inertias."""

import dataclasses
import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.chain import column, gravity_vector, set_columns
from fpid_pin.arms.parts import SIX, impossible, inertia_of, row_of
from fpid_pin.arms.rigid_body import RigidBody
from fpid_pin.checks import checked
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import shown

T = TypeVar("T")
#: Changes of a file's table; the keys of each are the method's arguments.
_NAMES = ("payload", "friction", "limits", "gravity", "armature", "inertias", "scaled_links")
#: Of an argument that has a number for each joint: what a message calls it, and the joint's field.
_FIELDS = {
    "viscous": ("viscous friction", "damping"), "dry": ("dry friction", "friction"),
    "effort": ("effort limit", "effort"), "velocity": ("velocity limit", "velocity"),
    "lower": ("lower limit", "lower"), "upper": ("upper limit", "upper"),
    "armature": ("armature", "armature"),
}  # fmt: skip
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

    def _with_numbers(self, change: str, **given: ArrayLike | None) -> Self:
        """Return the arm with other numbers of `_FIELDS`; what is None stays."""
        fields, columns = {}, {}
        for argument, value in given.items():
            if value is not None:
                name, key = _FIELDS[argument]
                low, limit = None if key in ("lower", "upper") else 0.0, change == "limits"
                numbers = checks.per_joint(name, value, self.n, low=low, finite=not limit)
                if limit and low is not None:
                    numbers = np.where(numbers > 0.0, numbers, np.inf)
                if limit:
                    none = np.copysign(np.inf, numbers)
                    numbers = np.where(np.abs(numbers) < _FAR, numbers, none)
                columns[key] = numbers
                fields[argument] = np.clip(numbers, -_FAR, _FAR) if limit else numbers
        return self._changed(change, fields, **columns)

    @checked
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
        given = np.zeros((3, 3)) if inertia is None else inertia
        about = checks.floats("inertia", given, shape=(3, 3))
        row = (mass, *centre, *about[SIX])
        if not np.array_equal(about, about.T):
            raise ArgumentError("inertia", "a symmetric matrix", about.tolist())
        if impossible(np.array([row]), rounding=1e-9)[0]:
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
            body = places[name].placement.act(inertia_of(row))
            rows[joint - 1] = row_of(self.model.inertias[joint] + body)
        fields = {"mass": mass, "com": centre, "frame": frame}
        fields["inertia"] = None if inertia is None else about
        return self._changed("payload", fields, inertia=rows)

    def with_friction(self, viscous: ArrayLike | None = None, dry: ArrayLike | None = None) -> Self:
        """Return the arm with other F_v [N m s/rad] or F_d [N m]; what is None stays."""
        return self._with_numbers("friction", viscous=viscous, dry=dry)

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
        given = {"effort": effort, "velocity": velocity, "lower": lower, "upper": upper}
        arm = self._with_numbers("limits", **given)
        for k in np.flatnonzero(~(arm.lower < arm.upper)):
            what = f"a number > {arm.lower[k]:g} for {self.joint_names[k]}"
            raise ArgumentError("upper limit", what, f"{arm.upper[k]:g}")
        return arm

    def with_gravity(self, gravity: ArrayLike) -> Self:
        """Return the arm under another gravity [m/s^2]: a number (along -z) or (3,)."""
        vector = gravity_vector("gravity", gravity)
        arm = self._changed("gravity", {"gravity": vector})
        arm.model.gravity.linear = np.array(vector)
        return arm

    def with_armature(self, armature: ArrayLike) -> Self:
        """Return the arm with other rotor inertias [kg m^2], seen at the joint."""
        return self._with_numbers("armature", armature=armature)

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
        given = {"mass": mass, "inertia": inertia}
        factors = {k: checks.per_joint(k, v, self.n, above=0.0) for k, v in given.items()}
        return self._changed("scaled_links", factors, inertia=self._scaled(**factors))

    def _scaled(self, mass: Any, inertia: Any) -> Any:
        """Return the links' inertias, (n, 10), their density and then their shape times (n,)."""
        rows = column(self.model, "inertia")
        rows[:, 0] *= mass
        rows[:, 4:] *= np.multiply(mass, inertia)[:, np.newaxis]
        return rows

    def with_changes(self, *tables: Mapping[str, Any]) -> Self:
        """Return the arm changed as files have it, ``{"payload": {"mass": 1.0}}``, in order."""
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
            arm = arm.with_friction(*(scale * [self.viscous_friction, self.dry_friction]))
        return arm


def call(make: Callable[..., T], fields: Mapping[str, Any], where: str) -> T:
    """Call `make` with the keys of a table, which are its arguments."""
    known = inspect.signature(make).parameters
    for key in fields:
        checks.choice(f"{where}.{key}", key, known, among="one of the keys")
    for key, parameter in known.items():
        if parameter.default is parameter.empty and key not in fields:
            raise ArgumentError(f"{where}.{key}", "a value", "none")
    return make(**fields)
