"""Planar n-R arms from lengths and masses: the n-link generalisation of eq. (35)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms.source import Parts, Source, gravity_entry, gravity_vector, limits_of
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError

#: The base is turned over about x, exactly: the joints' y axes are then the world's -y, about
#: which a positive angle takes x towards z (counter-clockwise in the x-z plane). Pinocchio has
#: faster code for joints about y than about an arbitrary axis.
_TURNED = np.diag((1.0, -1.0, -1.0))
#: Turns the z axis of a cylinder to x, along the link.
_ALONG_X = np.array(((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0)))
#: Turns the z axis of a cylinder to y, the joint's axis.
_ALONG_Y = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))


@dataclass(frozen=True, eq=False)
class PlanarSource(Source):
    """An arm of n parallel revolute joints in the vertical x-z plane.

    Parameters
    ----------
    lengths, masses
        Link lengths [m] and masses [kg], (n,), all positive.
    gravity
        (3,) or a number (downwards) [m/s^2].
    rods
        False: each mass is a point at the link's end, as in the paper. True: each link is a
        uniform thin rod, its centre of mass at half its length, inertia m l^2 / 12 about it.
    """

    lengths: ArrayLike
    masses: ArrayLike
    gravity: ArrayLike = 9.8
    rods: bool = False

    kind: ClassVar[str] = "planar"

    def __post_init__(self) -> None:
        lengths = checks.floats("lengths", self.lengths, above=0.0, max_ndim=1)
        masses = checks.floats("masses", self.masses, above=0.0, max_ndim=1)
        lengths, masses = (checks.read_only(np.atleast_1d(x)) for x in (lengths, masses))
        if lengths.shape != masses.shape:
            raise ArgumentError(
                "masses", f"shape {lengths.shape} (one for each length)", f"shape {masses.shape}"
            )
        checks.instance("rods", self.rods, bool, "True or False")
        object.__setattr__(self, "lengths", lengths)
        object.__setattr__(self, "masses", masses)
        object.__setattr__(self, "gravity", gravity_vector(self.gravity))

    def build(self) -> Parts:
        """Build the model: frames ``link1`` ... ``linkn`` at the joints and ``tool`` at the tip."""
        lengths: FloatArray = np.asarray(self.lengths)
        masses: FloatArray = np.asarray(self.masses)
        model = pin.Model()
        model.name = f"planar{lengths.size}"
        model.gravity.linear = np.array(self.gravity)
        joint = 0
        placement = pin.SE3(_TURNED, np.zeros(3))
        for k, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
            joint = model.addJoint(joint, pin.JointModelRY(), placement, f"joint{k}")
            model.addJointFrame(joint)
            end = np.array((length, 0.0, 0.0))
            if self.rods:
                across = mass * length**2 / 12.0
                inertia = pin.Inertia(mass, end / 2.0, np.diag((0.0, across, across)))
            else:
                inertia = pin.Inertia(mass, end, np.zeros((3, 3)))
            # Set, not appended: appending adds to a zero inertia and rounds the centre of mass.
            model.inertias[joint] = inertia
            model.addBodyFrame(f"link{k}", joint, pin.SE3.Identity(), -1)
            placement = pin.SE3(np.eye(3), end)
        model.addFrame(pin.Frame("tool", joint, placement, pin.FrameType.OP_FRAME))
        limits = limits_of(model)
        for bound, value in (("lower", -np.inf), ("upper", np.inf)):
            limits[bound] = np.full(lengths.size, value)
        return Parts(model, str(model.name), tool="tool", **limits)

    def table(self) -> dict[str, Any]:
        """Return lengths, masses, gravity and rods as plain values."""
        return {
            "lengths": np.asarray(self.lengths).tolist(),
            "masses": np.asarray(self.masses).tolist(),
            "gravity": gravity_entry(np.asarray(self.gravity)),
            "rods": self.rods,
        }

    def visual(self, model: Any) -> tuple[Any, Any]:
        """Draw cylinders for links and joints and, for point masses, spheres at the tips."""
        # The library of shapes that Pinocchio is built on; only a viewer needs it.
        import coal

        geometry = pin.GeometryModel()
        lengths, masses = np.asarray(self.lengths), np.asarray(self.masses)
        thick = 0.03 * float(lengths.mean())

        def add(name: str, joint: int, pose: Any, shape: Any, colour: tuple[float, ...]) -> None:
            thing = pin.GeometryObject(name, joint, pose, shape)
            thing.meshColor = np.array(colour)
            geometry.addGeometryObject(thing)

        for k, (length, mass) in enumerate(zip(lengths, masses, strict=True), start=1):
            hinge = pin.SE3(_ALONG_Y, np.zeros(3))
            add(
                f"joint{k}", k, hinge, coal.Cylinder(1.8 * thick, 5.0 * thick), (0.25, 0.27, 0.3, 1)
            )
            middle = pin.SE3(_ALONG_X, np.array((length / 2.0, 0.0, 0.0)))
            blue, orange = (0.2, 0.45, 0.7, 1), (0.85, 0.5, 0.15, 1)
            add(f"link{k}", k, middle, coal.Cylinder(thick, length), blue if k % 2 else orange)
            if not self.rods:
                # Volume in proportion to mass, so that the eye sees the payload.
                radius = 2.5 * thick * float(np.cbrt(mass / masses.max()))
                tip = pin.SE3(np.eye(3), np.array((length, 0.0, 0.0)))
                add(f"mass{k}", k, tip, coal.Sphere(radius), (0.65, 0.15, 0.15, 1))
        return model, geometry
