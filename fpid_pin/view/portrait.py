"""A still picture of an arm: its shapes in one pose, its joints numbered, and a scale."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.parts import PRISMATIC
from fpid_pin.checks import FloatArray
from fpid_pin.view.scene import stage, view_axes
from fpid_pin.view.shapes import Shape, joint_axis, shapes_of
from fpid_pin.view.style import colour, new_figure, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Where the light is, beside the camera: right, up, towards.
_LIGHT = np.array((0.35, 0.6, 0.72))
#: More triangles than this are not told apart in print.
_MOST = 60_000


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
    axes.plot([x, x + length], [y, y], color="#262626", linewidth=2.0, solid_capstyle="butt")
    axes.text(x + length / 2.0, y + 0.02 * half, f"{length:g} m", ha="center", va="bottom")
