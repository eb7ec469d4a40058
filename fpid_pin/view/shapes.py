"""What an arm looks like: its visual geometry as plain shapes, whichever viewer draws them."""

from __future__ import annotations

import warnings
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fpid_pin.arms import Arm
from fpid_pin.arms.parts import PRISMATIC, axis_of, solid_of
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError, FpidWarning

# Links take turns, so that the eye can tell one from the next where a file gives no colours.
_LINK_COLOURS = ((0.80, 0.82, 0.85), (0.36, 0.43, 0.52))
_JOINT_COLOUR = (0.25, 0.27, 0.30)
_UP = np.array((0.0, 0.0, 1.0))
#: Corners around a round solid.
_AROUND = 28
# The loader's own grey: the file gave no colour that it could read.
_NO_COLOUR = (0.9, 0.9, 0.9)


class Shape(NamedTuple):
    """A solid fixed to a joint's frame."""

    joint: int  # that carries it, -1 for the base
    placement: FloatArray  # pose in the joint's frame [m], (4, 4)
    colour: tuple[float, float, float, float]  # red, green, blue and opacity, in [0, 1]
    vertices: FloatArray  # of its surface, (V, 3) [m]
    triangles: NDArray[np.uint32]  # (T, 3)
    convex: bool = False  # around the origin of its frame


def shapes_of(arm: Arm) -> list[Shape]:
    """Return the shapes of an arm; joints without any are drawn as cylinders along the chain.

    Warns
    -----
    FpidWarning
        When visuals cannot be loaded; the arm is drawn from primitives instead.
    """
    try:
        _, geometry = arm.visual()
    except FpidError as error:
        warnings.warn(f"{error}; drawn from primitives instead", FpidWarning, stacklevel=2)
        geometry = None
    found = [] if geometry is None else [_shape(x) for x in geometry.geometryObjects]
    shapes = [shape for shape in found if shape is not None]
    drawn = {shape.joint for shape in shapes}
    return shapes + _primitives(arm, [j for j in range(arm.n) if j not in drawn])


def _shape(thing: Any) -> Shape | None:
    import coal

    joint = int(thing.parentJoint) - 1
    colour = np.clip(np.asarray(thing.meshColor, dtype=np.float64), 0.0, 1.0)
    if np.allclose(colour[:3], _NO_COLOUR, atol=1e-3):
        colour[:3] = _LINK_COLOURS[(joint + 1) % 2]
    red, green, blue, opacity = colour.tolist()
    rgba = (red, green, blue, opacity or 1.0)
    placement = np.array(thing.placement.homogeneous)
    solid = thing.geometry
    found = solid_of(solid)
    if found is not None:
        return Shape(joint, placement, rgba, *solid_surface(*found), convex=True)
    if isinstance(solid, coal.BVHModelBase) and solid.num_tris:
        triangle = solid.tri_indices
        corners = (triangle(k) for k in range(solid.num_tris))
        flat = np.fromiter((t[i] for t in corners for i in (0, 1, 2)), dtype=np.uint32)
        vertices = np.array(solid.vertices(), dtype=np.float64)
        return Shape(joint, placement, rgba, vertices, flat.reshape(-1, 3))
    # Planes and height fields are scenery, not parts of an arm.
    return None


def _primitives(arm: Arm, joints: list[int]) -> list[Shape]:
    """Draw `joints` as a hub along the axis and a cylinder to what the joint carries.

    A prismatic joint's hub is a box: it does not look as if it turned.
    """
    model, shapes = arm.model, list[Shape]()
    # Where, in each joint's frame, the next joint is; for the last one, the tool.
    origins = [np.array(model.jointPlacements[j].translation) for j in range(2, model.njoints)]
    tips = [*origins, tool_placement(arm)[1][:3, 3]]
    lengths = [float(np.linalg.norm(tip)) for tip in tips]
    thick = 0.04 * max(float(np.mean(lengths)), 1e-3)

    def add(joint: int, along: FloatArray, at: FloatArray, colour: tuple[float, float, float],
            kind: str, size: tuple[float, ...]) -> None:  # fmt: skip
        place = pin.SE3(pin.Quaternion.FromTwoVectors(_UP, along), at).homogeneous
        shapes.append(Shape(joint, place, (*colour, 1.0), *solid_surface(kind, size), convex=True))

    for joint in joints:
        slides = arm.joint_kinds[joint] == PRISMATIC
        size = (2.4 * thick, 2.4 * thick, 4.0 * thick) if slides else (1.6 * thick, 4.0 * thick)
        kind, axis = "box" if slides else "cylinder", joint_axis(model, joint)
        add(joint, axis, np.zeros(3), _JOINT_COLOUR, kind, size)
        if lengths[joint] >= 2.0 * thick:
            tip, colour = tips[joint], _LINK_COLOURS[(joint + 1) % 2]
            add(joint, tip, tip / 2.0, colour, "cylinder", (thick, lengths[joint]))
    return shapes


def solid_surface(kind: str, size: tuple[float, ...]) -> tuple[FloatArray, NDArray[np.uint32]]:
    """Return vertices [m] and triangles of a solid; for its kind and size see `solid_of`."""
    if kind == "box":
        corners = np.array(np.meshgrid(*[(-0.5, 0.5)] * 3, indexing="ij")).reshape(3, 8).T
        return corners * size, _BOX
    if kind == "ellipsoid":
        vertices, triangles = _turned(_arc(1.0, 0.0))
        return vertices * size, triangles
    radius, length = (*size, 0.0)[:2]
    if kind in ("sphere", "capsule"):
        return _turned(_arc(radius, length))
    top = 0.0 if kind == "cone" else radius
    half = 0.5 * length
    return _turned(np.array([(0.0, -half), (radius, -half), (top, half), (0.0, half)]))


_BOX = np.array(
    [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
     (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)], dtype=np.uint32,
)  # fmt: skip


def _arc(radius: float, length: float) -> FloatArray:
    """Return (radius, height) of half a circle whose two quarters are `length` apart, (K, 2)."""
    angle = np.linspace(-np.pi / 2.0, np.pi / 2.0, _AROUND // 2)
    height = radius * np.sin(angle) + np.where(angle < 0.0, -0.5, 0.5) * length
    return np.stack([radius * np.cos(angle), height], axis=1)


def _turned(outline: FloatArray) -> tuple[FloatArray, NDArray[np.uint32]]:
    """Turn (radius, height), (K, 2), about z into a surface."""
    angle = 2.0 * np.pi * np.arange(_AROUND) / _AROUND
    radius, height = outline.T
    rings = [np.outer(np.cos(angle), radius), np.outer(np.sin(angle), radius),
             np.broadcast_to(height, (_AROUND, len(outline)))]  # fmt: skip
    number = np.arange(_AROUND * len(outline), dtype=np.uint32).reshape(_AROUND, -1)
    following = np.roll(number, -1, axis=0)
    a, b, c, d = number[:, :-1], following[:, :-1], following[:, 1:], number[:, 1:]
    triangles = [np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, b, c), (a, c, d))]
    return np.stack(rings, axis=-1).reshape(-1, 3), np.concatenate(triangles)


def joint_axis(model: Any, joint: int) -> FloatArray:
    """Return what a joint turns about or slides along in its own frame, (3,), a unit vector."""
    axis = axis_of(model.joints[joint + 1])
    return np.asarray(axis / np.linalg.norm(axis))


def tool_placement(arm: Arm) -> tuple[int, FloatArray]:
    """Return the joint that carries the tool frame, and the frame's pose on it, (4, 4)."""
    frame = arm.model.frames[arm.model.getFrameId(arm.tool)]
    return int(frame.parentJoint) - 1, np.array(frame.placement.homogeneous)
