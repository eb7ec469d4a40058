"""The ways to make an arm: from paper, from a file, from a Pinocchio model."""

from __future__ import annotations

import os
from abc import abstractmethod
from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, Self, cast

import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import catalogue, mjcf, planar, robot_descriptions
from fpid_pin.arms.pinocchio_model import tree_of
from fpid_pin.arms.robot_file import kind_of, read_robot
from fpid_pin.arms.spec import ArmSpec, gravity_vector
from fpid_pin.arms.tree import Keep, Tree
from fpid_pin.arms.urdf import urdf_tree

Lock = Mapping[str, float] | None


class ArmConstructors:
    """What `Arm` is made by.

    These arguments are the same everywhere:

    lock : dict
        Joints to hold still, and where: ``{"finger": 0.02}`` [rad], prismatic ones [m]. A joint
        that mimics another follows it.
    keep : str or list of str
        The link at the arm's tip, or the arm's joints: all other joints are held where they are
        drawn.
    gravity : number (along -z) or (3,)
        [m/s^2]
    tool : str
        The frame that `Arm.tool_pose` means; None: one called ``tool``, else the last link.
    inertia : str
        What to do where a link that moves has a rotational inertia that no body has (a principal
        moment below 0, or above the sum of the others): ``"error"``; ``"nearest"`` takes the
        closest possible, and says by how much it differs; ``"accept"`` takes it as it is.
    """

    @classmethod
    @abstractmethod
    def _assembled(cls, spec: ArmSpec, origin: Mapping[str, Any] | None = None) -> Self:
        """Build the arm, with every check; `origin` is a shorter table that stands for it."""

    @classmethod
    def _from_tree(
        cls, tree: Tree, lock: Lock, keep: Keep | None, inertia: str, tool: str | None
    ) -> Self:
        spec = tree.serial(lock, keep, inertia, tool)
        arm = cls._assembled(spec)
        tree.warn(spec)
        return arm

    @classmethod
    def two_link(cls) -> Self:
        """Return the paper's robot (section 5.1) from ``urdf/two_link.urdf``, g = 9.8 m/s^2."""
        # `data` is a link to the repository's urdf folder; the wheel and the sdist hold the file.
        file = resources.files("fpid_pin.arms") / "data" / "two_link.urdf"
        tree = urdf_tree(file.read_bytes(), "two_link.urdf")
        # Pinocchio's own default is 9.81.
        tree.gravity = (0.0, 0.0, -9.8)
        return cls._assembled(tree.serial(), {"kind": "two_link"})

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
        return cls._assembled(*planar.planar_spec(lengths, masses, gravity, rods))

    @classmethod
    def from_file(
        cls, path: str | Path, lock: Lock = None, gravity: ArrayLike | None = None, **options: Any
    ) -> Self:
        """Read a URDF or MJCF file; its root element says which.

        `gravity` None is what the file says, else 9.81 m/s^2 along -z; `options` are those of
        `from_urdf` or `from_mjcf`.
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
            See `ArmConstructors`.
        package_dirs
            Folders to look up ``package://`` meshes in, besides those at and above the file.
        urdf
            The text of the URDF; `path` then says no more than where its meshes are.

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
        if urdf is not None:
            checks.plain("urdf", urdf, str, "the text of a URDF")
        if path is not None or urdf is None:
            checks.instance("path", path, (str, Path), "the path of a URDF file")
        checks.instance("package_dirs", package_dirs, (list, tuple), "a list of folders")
        for k, place in enumerate(package_dirs):
            checks.instance(f"package_dirs.{k}", place, (str, Path), "a folder")
        text = read_robot(cast("Path", path)) if urdf is None else urdf
        folder = None if path is None else Path(os.path.abspath(path)).parent
        tree = urdf_tree(text, str(path or "URDF"), folder, package_dirs)
        tree.gravity = tuple(gravity_vector(gravity).tolist())
        return cls._from_tree(tree, lock, keep, inertia, tool)

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
            See `ArmConstructors`; gravity None is the file's.
        arm
            The body at the arm's base, where the world holds several with joints.

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
        tree = mjcf.mjcf_tree(path, arm, keep)
        if gravity is not None:
            tree.gravity = tuple(gravity_vector(gravity).tolist())
        return cls._from_tree(tree, lock, keep, inertia, tool)

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

        The model is copied. A saved run holds it as a plain table of joints, frames and shapes
        (`fpid_pin.arms.spec.ArmSpec`). Continuous joints become revolute ones without limits:
        nq = nv = n.

        Parameters
        ----------
        model
            Limits, friction, damping and rotor inertia (`armature`) are taken from it, and its
            reference configuration ``home`` where it has one.
        lock, gravity, tool, keep, inertia
            See `ArmConstructors`; gravity None is the model's.
        geometry
            Its visual ``pinocchio.GeometryModel``; None: drawn from primitives. Meshes are found
            again where their files are.

        Raises
        ------
        ArmError
            As for `from_urdf`.
        """
        checks.instance("model", model, pin.Model, "a pinocchio.Model")
        if geometry is not None:
            checks.instance("geometry", geometry, pin.GeometryModel, "a pinocchio.GeometryModel")
        tree = tree_of(model, str(model.name) or "model", geometry)
        if gravity is not None:
            tree.gravity = tuple(gravity_vector(gravity).tolist())
        return cls._from_tree(tree, lock, keep, inertia, tool)

    @classmethod
    def from_example(
        cls, name: str, lock: Lock = None, keep: Keep | None = None, tool: str | None = None
    ) -> Self:
        """Return an arm of example-robot-data by its name (see `fpid_pin.arms.names`).

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        """
        tree, held = catalogue.example_tree(name)
        given = {"name": name, "lock": lock and dict(lock), "keep": keep, "tool": tool}
        origin = {"kind": "example"} | {key: value for key, value in given.items() if value}
        return cls._assembled(tree.serial({**held, **(lock or {})}, keep, tool=tool), origin)

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
            See `ArmConstructors`.

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        ArmError
            The package is missing (``pip install fpid_pin[descriptions]``), the download failed,
            or the file is refused as `from_urdf` and `from_mjcf` refuse it.
        """
        path, folders = robot_descriptions.described_file(name)
        options = {"keep": keep, "inertia": inertia, "tool": tool}
        if folders is None:
            return cls.from_mjcf(path, lock, gravity, **options)  # type: ignore[arg-type]
        down = 9.81 if gravity is None else gravity
        return cls.from_urdf(path, lock, down, folders, **options)  # type: ignore[arg-type]
