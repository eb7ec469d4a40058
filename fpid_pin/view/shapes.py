"""What an arm looks like: its shapes, where it is seen from, and a still picture of it."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike, NDArray

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.parts import PRISMATIC, axis_of, solid_of
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import FpidError, FpidWarning
from fpid_pin.view.style import INK, colour, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Links take turns, so that the eye can tell one from the next where a file gives no colours.
_LINK_COLOURS = ((0.80, 0.82, 0.85), (0.36, 0.43, 0.52))
_JOINT_COLOUR = (0.25, 0.27, 0.30)
_UP = np.array((0.0, 0.0, 1.0))
#: Corners around a round solid.
_AROUND = 28
# The loader's own grey: the file gave no colour that it could read.
_NO_COLOUR = (0.9, 0.9, 0.9)
#: Poses of a motion that the camera is fitted to.
_POSES = 120
#: Where the light of a portrait is, beside the camera: right, up, towards.
_LIGHT = np.array((0.35, 0.6, 0.72))
#: More triangles than this are not told apart in print.
_MOST = 60_000


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


# ------------------------------------------------------------------ the camera


class Stage(NamedTuple):
    """Where the arms stand and how they are looked at; world frame, z up [m]."""

    offsets: FloatArray  # of each run's base, (runs, 3)
    heights: FloatArray  # top of each run's motion, (runs,), for its caption
    towards: FloatArray  # unit vector from the scene to the camera, (3,)
    centre: FloatArray  # middle of the room to fit in, (3,)
    extent: FloatArray  # half sizes of that room to the right, up and in depth, (3,)
    floor: float  # height of the grid
    reach: float  # size of the largest arm
    planar: bool  # whether the first arm moves in a plane through its base


def stage(arms: list[Arm], motions: list[FloatArray]) -> Stage:
    """Place arms side by side, and fit the camera around the poses they go through, (K, n) each."""
    clouds = []
    for arm, motion in zip(arms, motions, strict=True):
        rows = np.linspace(0, len(motion) - 1, min(_POSES, len(motion))).astype(int)
        clouds.append(_joint_origins(arm, motion[rows]))
    reach = max(_reach(arm) for arm in arms)
    normal = _normal(arms[0])
    towards = _side(normal, clouds[0])
    axes = view_axes(towards)
    right, pad = axes[0], 0.12 * reach
    low = np.array([(cloud @ right).min() for cloud in clouds]) - pad
    high = np.array([(cloud @ right).max() for cloud in clouds]) + pad
    places = np.concatenate([[0.0], np.cumsum(high[:-1] - low[1:] + pad)])
    level = right * (1.0, 1.0, 0.0)
    offsets = (places - places.mean())[:, np.newaxis] * level / np.linalg.norm(level)
    everything = np.concatenate(
        [(c + o).reshape(-1, 3) for c, o in zip(clouds, offsets, strict=True)]
    )
    room = everything @ axes.T
    first, last = room.min(axis=0), room.max(axis=0)
    lowest = float(everything[:, 2].min())
    return Stage(
        offsets=offsets, heights=np.array([cloud[..., 2].max() for cloud in clouds]),
        towards=towards, centre=(first + last) / 2.0 @ axes, extent=(last - first) / 2.0 + pad,
        floor=lowest - pad if lowest < -0.1 * reach else 0.0, reach=reach,
        planar=normal is not None,
    )  # fmt: skip


def view_axes(towards: FloatArray) -> FloatArray:
    """Return the unit vectors to the right, up and towards the camera, one a row."""
    right = np.cross(_UP, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def _joint_origins(arm: Arm, poses: FloatArray) -> FloatArray:
    """Return base, joint origins and tool for poses (K, n): (K, n + 2, 3) [m]."""
    model, data = arm.model, arm.model.createData()
    tool = model.getFrameId(arm.tool)
    points = np.zeros((len(poses), arm.n + 2, 3))
    for k, q in enumerate(poses):
        pin.forwardKinematics(model, data, q)
        points[k, 1:-1] = [data.oMi[joint].translation for joint in range(1, arm.n + 1)]
        points[k, -1] = pin.updateFramePlacement(model, data, tool).translation
    return points


def _reach(arm: Arm) -> float:
    """Return how far the tool can be from the first joint at most [m]."""
    origins = [arm.model.jointPlacements[j].translation for j in range(2, arm.n + 1)]
    length = sum(np.linalg.norm(x) for x in (*origins, tool_placement(arm)[1][:3, 3]))
    # Half of what a prismatic joint travels lies beyond its middle.
    slides = np.array([kind == PRISMATIC for kind in arm.joint_kinds])
    travel = np.where(slides, 0.5 * (arm.upper - arm.lower), 0.0)
    return max(float(length + travel[np.isfinite(travel)].sum()), 1e-3)


def _normal(arm: Arm) -> FloatArray | None:
    """Return the normal of the plane along which all of an arm moves, else None."""
    poses = np.sin(np.multiply.outer(np.arange(8.0), np.arange(1, arm.n + 1)))
    points = _joint_origins(arm, poses)
    moves = (points - points[0]).reshape(-1, 3)
    if np.linalg.matrix_rank(moves, tol=1e-9) < 2:
        # Along a line: look at it from the side.
        moves = np.vstack([moves, _UP])
    _, sizes, axes = np.linalg.svd(moves, full_matrices=False)
    return np.asarray(axes[2]) if sizes[2] < 1e-9 * sizes[0] else None


def _side(normal: FloatArray | None, points: FloatArray) -> FloatArray:
    """Return the unit vector towards the camera for one arm that moves through `points`."""
    if normal is not None and abs(normal[2]) > 0.9:
        return np.asarray(np.array((0.0, -0.35, 1.0)) / np.hypot(0.35, 1.0))
    if normal is None:
        # Look across the direction in which the arm is spread out most.
        flat = points.reshape(-1, 3)[:, :2]
        spread = np.linalg.svd(flat - flat.mean(axis=0), full_matrices=False)[2][0]
        across, aside, above = np.array((spread[1], -spread[0], 0.0)), 0.45, 0.45
    else:
        across, aside, above = normal * (1.0, 1.0, 0.0), 0.18, 0.16
    across = across / np.linalg.norm(across)
    # Of the two sides take the one from which +x (or else +y) is on the right.
    right = np.cross(_UP, across)
    if right[0] < -1e-6 or (abs(right[0]) <= 1e-6 and right[1] < 0.0):
        across, right = -across, -right
    towards = across + aside * right + above * _UP
    return np.asarray(towards / np.linalg.norm(towards))


# ------------------------------------------------------------------ a portrait


@styled
def portrait(arm: Arm, q: ArrayLike | None = None) -> Figure:
    """Draw an arm in the pose q, (n,); None: at home.

    Joints are numbered from 1 at the base; a line shows what each turns about (dashed) or slides
    along (whole). The view is parallel, so that the scale below is true across it.
    """
    from matplotlib.collections import PolyCollection

    pose = checks.vector("q", arm.home if q is None else q, arm.n)
    place = stage([arm], [pose[np.newaxis]])
    view = view_axes(place.towards)
    figure, (axes,) = new_figure(1, 1, 5.0, 5.0)
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, pose)
    corners, colours = _seen(shapes_of(arm), data, view)
    faces = PolyCollection(list(corners[..., :2]), facecolors=colours, edgecolors="none")
    # As pixels within an SVG: a robot is some ten thousand triangles.
    faces.set(rasterized=True, antialiased=False)
    axes.add_collection(faces)
    for j in range(arm.n):
        _mark(axes, arm, j, data.oMi[j + 1], view, 0.09 * place.reach)
    everything = corners[..., :2].reshape(-1, 2)
    low, high = everything.min(axis=0), everything.max(axis=0)
    middle, half = (low + high) / 2.0, 0.62 * max(float((high - low).max()), 1e-3)
    axes.set(
        xlim=(middle[0] - half, middle[0] + half), ylim=(middle[1] - half, middle[1] + half),
        aspect="equal",
    )  # fmt: skip
    axes.set_axis_off()
    _scale(axes, middle - (0.94 * half, 0.94 * half), half)
    return figure


def _seen(shapes: list[Shape], data: Any, view: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return triangles (T, 3, 3), right, up, towards, the farthest first; and colours (T, 4)."""
    corners, colours = [], []
    for shape in shapes:
        world = np.eye(4) if shape.joint < 0 else data.oMi[shape.joint + 1].homogeneous
        pose = world @ shape.placement
        own = shape.vertices[shape.triangles]
        faces = (own @ pose[:3, :3].T + pose[:3, 3]) @ view.T
        if shape.convex:
            # Of its far side, long triangles would shine through.
            outwards = (_normals(own) * own.mean(axis=1)).sum(axis=1)
            faces = faces[_normals(faces)[:, 2] * outwards >= 0.0]
        corners.append(faces[:: 1 + len(faces) // _MOST])
        colours.append(np.tile(shape.colour, (len(corners[-1]), 1)))
    seen, tint = np.concatenate(corners), np.concatenate(colours)
    # Files do not agree on which side of a triangle is outside.
    light = np.abs(_normals(seen) @ (_LIGHT / np.linalg.norm(_LIGHT)))
    tint[:, :3] *= 0.55 + 0.45 * light[:, np.newaxis]
    order = np.argsort(seen[:, :, 2].mean(axis=1))
    return seen[order], np.clip(tint[order], 0.0, 1.0)


def _normals(faces: FloatArray) -> FloatArray:
    """Return the unit normals of triangles (T, 3, 3); 0 of those without area."""
    normal = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    return np.asarray(normal / np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30))


def _mark(axes: Axes, arm: Arm, joint: int, place: Any, view: FloatArray, size: float) -> None:
    """Draw a joint's axis and number."""
    at = view @ place.translation
    along = view @ place.rotation @ joint_axis(arm.model, joint) * size
    ends = np.stack([at - along, at + along])
    slides = arm.joint_kinds[joint] == PRISMATIC
    own = colour(joint)
    axes.plot(
        ends[:, 0], ends[:, 1], color=own, linestyle="-" if slides else (0, (3, 1.5)),
        linewidth=1.5,
    )  # fmt: skip
    axes.annotate(
        str(joint + 1), (float(ends[1, 0]), float(ends[1, 1])), color="white", ha="center",
        va="center", fontsize=8,
        bbox={"boxstyle": "circle,pad=0.2", "facecolor": own, "edgecolor": "none"},
    )  # fmt: skip


def _scale(axes: Axes, corner: FloatArray, half: float) -> None:
    """Draw a bar of a round length in the lower left corner."""
    decade = 10.0 ** np.floor(np.log10(0.5 * half))
    length = decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= 0.5 * half)
    x, y = corner
    axes.plot([x, x + length], [y, y], color=INK, linewidth=2.0, solid_capstyle="butt")
    axes.text(x + length / 2.0, y + 0.02 * half, f"{length:g} m", ha="center", va="bottom")
