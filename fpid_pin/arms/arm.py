"""The arm: a fixed-base chain of joints on Pinocchio, with the terms of eq. (5)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any, Self

from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin.arms import catalogue
from fpid_pin.arms.chain import Chain, gravity_vector, table_of
from fpid_pin.arms.changes import ArmChanges, call
from fpid_pin.arms.mjcf import mjcf_tree
from fpid_pin.arms.parts import Shape, geometry_of
from fpid_pin.arms.planar import planar_chain
from fpid_pin.arms.robot_file import kind_of
from fpid_pin.arms.tree import HoldError, Keep, Tree, tree_of
from fpid_pin.arms.urdf import urdf_tree

Lock = Mapping[str, float] | None


@dataclass(frozen=True, eq=False, repr=False)
class Arm(ArmChanges):
    """A robot arm with n revolute or prismatic joints; immutable and picklable.

    Made by `two_link`, `planar`, `from_file`, `from_model` and their kin, and from other arms by
    `with_payload` and its kin. What is an angle [rad] or a torque [N m] below is a length [m] or a
    force [N] for a prismatic joint: see `units`. The rigid-body terms are those of

        M(q) q'' + C(q, q') q' + G(q) = tau                                             (5)

    without friction, which is kept beside them (`viscous_friction`, `dry_friction`).

    Attributes
    ----------
    name : str
    joint_names : tuple of str
        In the order of every (n,) array.
    lower, upper : ndarray, (n,)
        Position limits [rad]; -inf, inf where there are none.
    effort_limit, velocity_limit : ndarray, (n,)
        [N m] and [rad/s]; inf where none is given (a URDF's 0 means that too).
    viscous_friction, dry_friction : ndarray, (n,)
        F_v [N m s/rad] and F_d [N m].
    home : ndarray, (n,)
        A pose within the limits: the catalogue's, else the middle of the limits, else 0.
    tool : str
        The frame that `tool_pose` and `with_payload` mean.
    credit : str
        Origin and licence of the arm's description, where known.
    model : pinocchio.Model
        nq = nv = n. Treat it as read-only.

    Notes
    -----
    These arguments are the same for all that read an arm:

    lock : dict
        Joints to hold still, and where: ``{"finger": 0.02}`` [rad], prismatic ones [m]. A joint
        that mimics another follows it.
    keep : str or list of str
        The last link of the arm, or a list of its joints; all other joints are held in the pose
        of the file.
    gravity : number (along -z) or (3,)
        Gravity [m/s^2]; a number points along -z.
    tool : str
        The frame of `Arm.tool_pose` and payloads; None: one called ``tool``, else the last link.
    inertia : str
        What to do where a link that moves has a rotational inertia that no body has (a principal
        moment below 0, or above the sum of the others): ``"error"``; ``"nearest"`` takes the
        closest possible, and says by how much it differs; ``"accept"`` takes it as it is.
    """

    credit: str = ""
    _shapes: tuple[Shape, ...] = ()
    _inertia: str = "error"
    _origin: Mapping[str, Any] | None = None

    def __repr__(self) -> str:
        changes = "".join(f" + {name}" for change in self._changes for name in change)
        return f"<Arm {self.name}{changes}, {self.n} joints>"

    def visual(self) -> tuple[Any, Any]:
        """Return (model, visual ``pinocchio.GeometryModel``) for a viewer, loaded on first use.

        Warns
        -----
        FpidWarning
            Once, when meshes are missing; the geometry is then incomplete.
        """
        kept = vars(self)
        if "_geometry" not in kept:
            kept["_geometry"] = geometry_of(self._shapes, self.name)
        return self.model, kept["_geometry"].copy()

    def to_dict(self) -> dict[str, Any]:
        """Return the table that `fpid_pin.descriptions.from_dict` rebuilds the arm from."""
        if self._origin is None:
            # Changes are in its numbers.
            fields = {"tool": self.tool, "credit": self.credit, "inertia": self._inertia}
            return {"kind": "model", **table_of(self.model, self._shapes, **fields)}
        table = dict(self._origin)
        return table | {"changes": list(self._changes)} if self._changes else table

    # ------------------------------------------------------------------ how it is made

    @classmethod
    def _of(cls, chain: Chain, origin: Mapping[str, Any] | None = None) -> Self:
        """Build the arm, with every check; `origin` is a shorter table that stands for it."""
        arm = cls(
            chain.model(), chain.tool_frame, credit=chain.credit, _shapes=tuple(chain.shapes),
            _inertia=chain.inertia, _origin=origin,
        )  # fmt: skip
        arm._require_regular()
        return arm

    @classmethod
    def _from_tree(cls, tree: Tree, gravity: Any, *options: Any, origin: Any = None) -> Self:
        """Build the arm of a tree; `options` are those of `Tree.serial`."""
        if gravity is not None:
            tree.gravity = gravity_vector("gravity", gravity)
        chain = tree.serial(*options)
        arm = cls._of(chain, origin)
        if origin is None:
            tree.warn(chain)
        return arm

    @classmethod
    def two_link(cls) -> Self:
        """Return the paper's robot (section 5.1) from ``urdf/two_link.urdf``, g = 9.8 m/s^2."""
        # `data` is a link to the repository's urdf folder; the wheel and the sdist hold the file.
        file = resources.files("fpid_pin.arms") / "data" / "two_link.urdf"
        tree = urdf_tree(None, file.read_text(encoding="utf-8"))
        return cls._from_tree(tree, 9.8, origin={"kind": "two_link"})

    @classmethod
    def planar(
        cls,
        lengths: ArrayLike,
        masses: ArrayLike,
        gravity: ArrayLike = 9.8,
        rods: bool = False,
    ) -> Self:
        """Return an n-R arm in the vertical x-z plane; angles are counter-clockwise from x.

        Parameters
        ----------
        lengths, masses
            Link lengths [m] and masses [kg], (n,).
        gravity
            A number (along -z) or (3,) [m/s^2]; 0 for a horizontal arm.
        rods
            False: point masses at the link ends (the paper's). True: uniform thin rods.

        Raises
        ------
        ArgumentError
            Lengths or masses that are not positive, or not as many of one as of the other.
        """
        return cls._of(*planar_chain(lengths, masses, gravity, rods))

    @classmethod
    def from_file(
        cls, path: str | Path, lock: Lock = None, gravity: ArrayLike | None = None, **options: Any
    ) -> Self:
        """Read a URDF or MJCF file; its root element says which.

        `gravity` None is what the file says, else 9.81 m/s^2 along -z; `options`, and what is
        raised, are those of `from_urdf` or `from_mjcf`.
        """
        if kind_of(path) == "robot":
            return cls.from_urdf(path, lock, 9.81 if gravity is None else gravity, **options)
        return cls.from_mjcf(path, lock, gravity, **options)

    @classmethod
    def from_urdf(
        cls,
        path: str | Path | None = None,
        lock: Lock = None,
        gravity: ArrayLike = 9.81,
        package_dirs: Sequence[str | Path] = (),
        keep: Keep | None = None,
        inertia: str = "error",
        tool: str | None = None,
        urdf: str | None = None,
    ) -> Self:
        """Read a fixed-base serial chain of revolute, continuous or prismatic joints.

        A saved run holds what was read, a plain table, and not the file.

        Parameters
        ----------
        path
            The URDF file.
        lock, gravity, keep, inertia, tool
            See `Arm`.
        package_dirs
            Folders to look up ``package://`` meshes in, besides those at and above the file.
        urdf
            The text of the URDF; `path` then only says where its meshes are.

        Raises
        ------
        ArmError
            What urdfdom or Pinocchio refuse, in their words; a file that xacro has to read first; a
            tree, or a joint without one axis, that is not held; a mass or inertia that no body has;
            a link without mass that leaves the mass matrix singular.

        Warns
        -----
        FpidWarning
            Limits that are none, or were not taken as they stand, by joint.
        """
        return cls._from_tree(
            urdf_tree(path, urdf, package_dirs), gravity, lock, keep, inertia, tool
        )

    @classmethod
    def from_mjcf(
        cls,
        path: str | Path,
        lock: Lock = None,
        gravity: ArrayLike | None = None,
        keep: Keep | None = None,
        arm: str | None = None,
        inertia: str = "error",
        tool: str | None = None,
    ) -> Self:
        """Read a fixed-base serial chain of hinges and slides from MuJoCo's MJCF.

        MuJoCo's own compiler reads the file (``pip install fpid_pin[mujoco]``). A saved run holds
        what was read, a plain table, and not the file. Effort limits are the joints'
        ``actuatorfrcrange`` and the ``forcerange`` of actuators, or a motor's ``ctrlrange``, times
        their gear; rotor inertia and damping of actuators count; what else they do is not read.

        Parameters
        ----------
        path
            The MJCF file.
        lock, gravity, keep, inertia, tool
            See `Arm`; gravity None is the file's.
        arm
            The body of the arm's base, if several bodies of the world have joints.

        Raises
        ------
        FpidError
            MuJoCo is not installed, or refuses the file.
        ArmError
            As for `from_urdf`; several bodies of the world have joints.

        Warns
        -----
        FpidWarning
            What is left out: springs, equality constraints, tendons, gravity compensation, fluid,
            other bodies that move.
        """
        return cls._from_tree(mjcf_tree(path, arm, keep), gravity, lock, keep, inertia, tool)

    @classmethod
    def from_model(
        cls,
        model: Any,
        lock: Lock = None,
        gravity: ArrayLike | None = None,
        geometry: Any = None,
        tool: str | None = None,
        keep: Keep | None = None,
        inertia: str = "error",
    ) -> Self:
        """Return the arm that a ``pinocchio.Model`` is: a fixed-base serial chain.

        The model is copied; continuous joints become revolute ones without limits: nq = nv = n.
        A saved run holds a plain table of joints, frames and shapes (`fpid_pin.arms.chain.Chain`).

        Parameters
        ----------
        model
            Limits, friction, damping and rotor inertia (`armature`) are taken from it, and its
            reference configuration ``home`` where it has one.
        lock, gravity, tool, keep, inertia
            See `Arm`; gravity None is the model's.
        geometry
            Its visual ``pinocchio.GeometryModel``; None: drawn from primitives. Meshes are found
            again where their files are.

        Raises
        ------
        ArmError
            As for `from_urdf`.
        """
        return cls._from_tree(tree_of(model, geometry), gravity, lock, keep, inertia, tool)

    @classmethod
    @checks.checked
    def from_example(
        cls, name: str, lock: Lock = None, keep: Keep | None = None, tool: str | None = None
    ) -> Self:
        """Return an arm of example-robot-data by its name (see `fpid_pin.arms.names`).

        Parameters
        ----------
        name
            One of `fpid_pin.arms.names`.
        lock, keep, tool
            See `Arm`; the arm's own fingers are held besides.

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        """
        tree, held = catalogue.example_tree(name)
        given = {"name": name, "lock": lock and dict(lock), "keep": keep, "tool": tool}
        origin = {"kind": "example"} | {key: value for key, value in given.items() if value}
        locks = {**held, **(lock or {})}
        return cls._from_tree(tree, None, locks, keep, "error", tool, origin=origin)

    @classmethod
    def from_description(
        cls,
        name: str,
        lock: Lock = None,
        gravity: ArrayLike | None = None,
        keep: Keep | None = None,
        inertia: str = "error",
        tool: str | None = None,
    ) -> Self:
        """Return an arm of robot_descriptions by its module's name, ``"ur5e_description"``.

        That package downloads the robot's repository the first time, with git, and writes out by
        xacro what is written for it, which evaluates expressions of the repository. A saved run
        holds what was read, so that reading it needs none of this.

        Parameters
        ----------
        name
            As ``robot_descriptions`` has it.
        lock, gravity, keep, inertia, tool
            See `Arm`.

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        FpidError
            The package is missing (``pip install fpid_pin[descriptions]``), the download failed,
            or the file is refused as `from_urdf` and `from_mjcf` refuse it.
        """
        path, where = catalogue.described_file(name)
        return cls.from_file(path, lock, gravity, keep=keep, inertia=inertia, tool=tool, **where)

    @classmethod
    def from_table(cls, table: Mapping[str, Any]) -> "Arm":
        """Build the arm of a file's ``[arm]`` table, which `to_dict` returns.

        It has a ``kind``, whose keys are the arguments in `KINDS` or the fields of a `Chain`, and
        ``changes``, a list of what `with_changes` takes.
        """
        kind = checks.choice("kind", table.get("kind"), sorted([*KINDS, "model"]))
        changes = table.get("changes", ())
        checks.instance("changes", changes, (list, tuple), "a list of tables")
        fields = {key: value for key, value in table.items() if key not in ("kind", "changes")}
        try:
            if kind == "model":
                arm = Arm._of(descriptions.from_dict(fields, Chain))
            else:
                arm = call(KINDS[kind], fields, "arm")
        except HoldError as error:
            raise error.written("toml") from None
        return arm.with_changes(*changes)


#: What makes the arm of a file's ``[arm]`` table, by its kind; there is also ``model``.
KINDS: dict[str, Callable[..., Arm]] = {
    "two_link": Arm.two_link,
    "planar": Arm.planar,
    "urdf": Arm.from_urdf,
    "mjcf": Arm.from_mjcf,
    "example": Arm.from_example,
    "description": Arm.from_description,
}
