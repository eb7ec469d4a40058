"""The ways to make an arm: from paper, from a file of any kind, from a Pinocchio model."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.catalogue import ExampleSource
from fpid_pin.arms.mjcf import read_mjcf
from fpid_pin.arms.pinocchio_model import source_of
from fpid_pin.arms.planar import PlanarSource
from fpid_pin.arms.robot_descriptions import read_description
from fpid_pin.arms.sdf import read_sdf
from fpid_pin.arms.source import Source
from fpid_pin.arms.two_link import TwoLinkSource
from fpid_pin.arms.urdf import UrdfSource
from fpid_pin.arms.xml_text import kind_of, read_text

if TYPE_CHECKING:
    from fpid_pin.arms.arm import Arm


class Making:
    """What `Arm` is made by.

    `lock` names joints to hold still, and where: ``{"finger": 0.02}`` ([rad]; prismatic joints
    [m]). `gravity` is a number (along -z) or (3,) [m/s^2].
    """

    @classmethod
    @abstractmethod
    def _assembled(cls, source: Source) -> Arm:
        """Build the arm of a source, with every check."""

    @classmethod
    def two_link(cls) -> Arm:
        """Return the paper's robot (section 5.1) from ``urdf/two_link.urdf``, g = 9.8 m/s^2."""
        return cls._assembled(TwoLinkSource())

    @classmethod
    def planar(
        cls,
        lengths: ArrayLike,
        masses: ArrayLike,
        gravity: ArrayLike = 9.8,
        rods: bool = False,
    ) -> Arm:
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
        return cls._assembled(PlanarSource(lengths, masses, gravity, rods))

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
    ) -> Arm:
        """Read a URDF, MJCF or SDF file; its root element says which.

        `gravity` None is what the file says, else 9.81 m/s^2 along -z.

        Raises
        ------
        ArmError
            See `from_urdf`, `from_mjcf`, `from_sdf`.
        """
        kind = kind_of(path)
        if kind == "robot":
            return cls.from_urdf(path, lock, 9.81 if gravity is None else gravity)
        return (cls.from_mjcf if kind == "mujoco" else cls.from_sdf)(path, lock, gravity)

    @classmethod
    def from_urdf(
        cls,
        path: str | Path,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike = 9.81,
        package_dirs: Sequence[str | Path] | None = None,
    ) -> Arm:
        """Read a fixed-base serial chain of revolute, continuous or prismatic joints.

        Parameters
        ----------
        path
            The URDF file.
        lock, gravity
            See `Making`.
        package_dirs
            Folders to look up ``package://`` meshes in, besides those at and above the file.

        Raises
        ------
        ArmError
            A file that is missing, broken, or one that xacro has to read first; a joint without
            one axis, or that mimics another, and is not locked; a tree; a mass or inertia that no
            body has; a link without mass that leaves the mass matrix singular.
        """
        text = read_text(path)
        dirs = () if package_dirs is None else package_dirs
        return cls._assembled(UrdfSource(text, str(path), lock or {}, gravity, dirs))  # type: ignore[arg-type]

    @classmethod
    def from_mjcf(
        cls,
        path: str | Path,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
    ) -> Arm:
        """Read a fixed-base serial chain of hinges and slides from MuJoCo's MJCF.

        A saved run holds what was read (see `from_model`), and not the file. Effort limits are
        the joints' ``actuatorfrcrange`` and the ``forcerange`` of actuators, or a motor's
        ``ctrlrange``, times their gear; what else actuators do is not read.

        Parameters
        ----------
        path
            The MJCF file, written out: without includes, frames or replicates.
        lock, gravity
            See `Making`; gravity None is the file's.

        Raises
        ------
        ArmError
            As for `from_urdf`; a body with meshes and no ``<inertial>``, whose mass Pinocchio
            would make up.

        Warns
        -----
        FpidWarning
            What is left out: springs, equality constraints, tendons.
        """
        return cls._assembled(read_mjcf(path, lock, gravity))

    @classmethod
    def from_sdf(
        cls,
        path: str | Path,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
    ) -> Arm:
        """Read a fixed-base serial chain from SDF, where Pinocchio was built with its parser.

        Parameters
        ----------
        path
            The SDF file.
        lock, gravity
            See `Making`; gravity None is the file's.

        Raises
        ------
        ArmError
            As for `from_urdf`; a Pinocchio without the parser, as in the wheel.
        """
        return cls._assembled(read_sdf(path, lock, gravity))

    @classmethod
    def from_model(
        cls,
        model: Any,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
        geometry: Any = None,
        tool: str | None = None,
    ) -> Arm:
        """Return the arm that a ``pinocchio.Model`` is: a fixed-base serial chain.

        The model is copied. A saved run holds it as a plain table of joints, inertias, placements
        and frames (`fpid_pin.arms.model.ModelSource`). Continuous joints become revolute ones
        without limits: nq = nv = n.

        Parameters
        ----------
        model
            Limits, friction, damping and rotor inertia (`armature`) are taken from it, and its
            reference configuration ``home`` where it has one.
        lock, gravity
            See `Making`; gravity None is the model's.
        geometry
            Its visual ``pinocchio.GeometryModel``; None: drawn from primitives. Meshes are found
            again where their files are.
        tool
            The frame that `Arm.tool_pose` means; None: one called ``tool``, else the last.

        Raises
        ------
        ArmError
            As for `from_urdf`.
        """
        checks.instance("model", model, pin.Model, "a pinocchio.Model")
        if geometry is not None:
            checks.instance("geometry", geometry, pin.GeometryModel, "a pinocchio.GeometryModel")
        label = str(model.name) or "model"
        return cls._assembled(
            source_of(model, label=label, lock=lock, gravity=gravity, geometry=geometry, tool=tool)
        )

    @classmethod
    def from_example(cls, name: str, lock: Mapping[str, float] | None = None) -> Arm:
        """Return an arm of example-robot-data by its name (see `fpid_pin.arms.names`).

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        """
        return cls._assembled(ExampleSource(name, lock or {}))

    @classmethod
    def from_description(
        cls,
        name: str,
        lock: Mapping[str, float] | None = None,
        gravity: ArrayLike | None = None,
    ) -> Arm:
        """Return an arm of robot_descriptions by its module's name, ``"ur5e_description"``.

        That package downloads the robot's repository the first time, with git, and writes out by
        xacro what is written for it, which evaluates expressions of the repository. A saved run
        holds what was read, so that reading it needs none of this.

        Parameters
        ----------
        name
            As ``robot_descriptions`` has it.
        lock, gravity
            See `Making`.

        Raises
        ------
        ArgumentError
            An unknown name; the message gives the nearest.
        ArmError
            The package is missing (``pip install fpid_pin[descriptions]``), the download failed,
            or the file is refused as `from_urdf` and `from_mjcf` refuse it.
        """
        return cls._assembled(read_description(name, lock, gravity))
