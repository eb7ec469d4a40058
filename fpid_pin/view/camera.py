"""Where to look from: a view direction, the room to fit in, the floor, side by side places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from fpid_pin.arms import Arm
from fpid_pin.arms.joints import PRISMATIC
from fpid_pin.checks import FloatArray

_UP = np.array((0.0, 0.0, 1.0))
_POSES = 120


@dataclass(frozen=True, eq=False)
class Stage:
    """Where the arms stand and how they are looked at; world frame, z up [m].

    Attributes
    ----------
    offsets
        Where each run's base stands, (runs, 3).
    heights
        Top of each run's motion, (runs,), for its caption.
    towards
        Unit vector from the scene to the camera, (3,).
    centre, extent
        Middle of the room to fit in, (3,), and its half sizes to the right, up and in depth, (3,).
    floor
        Height of the grid.
    reach
        Size of the largest arm.
    planar
        Whether the first arm moves in a plane through its base.
    """

    offsets: FloatArray
    heights: FloatArray
    towards: FloatArray
    centre: FloatArray
    extent: FloatArray
    floor: float
    reach: float
    planar: bool


def joint_origins(arm: Arm, poses: FloatArray) -> FloatArray:
    """Return base, joint origins and tool for poses (K, n): (K, n + 2, 3) [m]."""
    model, data = arm.model, arm.model.createData()
    tool = model.getFrameId(arm.tool)
    points = np.zeros((len(poses), arm.n + 2, 3))
    for k, q in enumerate(poses):
        pin.forwardKinematics(model, data, q)
        for joint in range(1, arm.n + 1):
            points[k, joint] = data.oMi[joint].translation
        points[k, -1] = pin.updateFramePlacement(model, data, tool).translation
    return points


def reach_of(arm: Arm) -> float:
    """Return how far the tool can be from the first joint at most [m]."""
    origins = [arm.model.jointPlacements[j].translation for j in range(2, arm.n + 1)]
    tool = arm.model.frames[arm.model.getFrameId(arm.tool)].placement.translation
    length = float(sum(np.linalg.norm(origin) for origin in (*origins, tool)))
    # Half of what a prismatic joint travels lies beyond its middle.
    slides = np.array([kind == PRISMATIC for kind in arm.joint_kinds])
    travel = np.where(slides, 0.5 * (arm.upper - arm.lower), 0.0)
    return max(length + float(travel[np.isfinite(travel)].sum()), 1e-3)


def _normal(arm: Arm) -> FloatArray | None:
    """Return the normal of the plane along which all of an arm moves, else None."""
    points = joint_origins(arm, np.sin(np.multiply.outer(np.arange(8.0), np.arange(1, arm.n + 1))))
    moves = (points - points[0]).reshape(-1, 3)
    if np.linalg.matrix_rank(moves, tol=1e-9) < 2:
        # Along a line: look at it from the side.
        moves = np.vstack([moves, _UP])
    _, sizes, axes = np.linalg.svd(moves, full_matrices=False)
    return np.asarray(axes[2]) if sizes[2] < 1e-9 * sizes[0] else None


def _side(normal: FloatArray | None, points: FloatArray) -> FloatArray:
    """Return the unit vector towards the camera for one arm that moves through `points`."""
    if normal is not None and abs(normal[2]) > 0.9:
        towards = np.array((0.0, -0.35, 1.0))
    else:
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


def view_axes(towards: FloatArray) -> FloatArray:
    """Return the unit vectors to the right, up and towards the camera, one a row."""
    right = np.cross(_UP, towards)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(towards, right), towards])


def stage(arms: list[Arm], motions: list[FloatArray]) -> Stage:
    """Place the runs side by side and fit the camera around them.

    Parameters
    ----------
    arms
        One a run.
    motions
        Poses each arm goes through, actual and desired, (K, n) each.
    """
    clouds = []
    for arm, motion in zip(arms, motions, strict=True):
        rows = np.linspace(0, len(motion) - 1, min(_POSES, len(motion))).astype(int)
        clouds.append(joint_origins(arm, motion[rows]))
    reach = max(reach_of(arm) for arm in arms)
    normal = _normal(arms[0])
    towards = _side(normal, clouds[0])
    axes = view_axes(towards)
    right = axes[0]
    pad = 0.12 * reach
    low = np.array([(cloud @ right).min() for cloud in clouds]) - pad
    high = np.array([(cloud @ right).max() for cloud in clouds]) + pad
    places = np.zeros(len(arms))
    for k in range(1, len(arms)):
        places[k] = places[k - 1] + high[k - 1] - low[k] + pad
    level = right * (1.0, 1.0, 0.0)
    offsets = (places - places.mean())[:, np.newaxis] * level / np.linalg.norm(level)
    everything = np.concatenate(
        [(c + o).reshape(-1, 3) for c, o in zip(clouds, offsets, strict=True)]
    )
    room = everything @ axes.T
    centre = (room.min(axis=0) + room.max(axis=0)) / 2.0 @ axes
    extent = (room.max(axis=0) - room.min(axis=0)) / 2.0 + pad
    lowest = float(everything[:, 2].min())
    return Stage(
        offsets=offsets,
        heights=np.array([cloud[..., 2].max() for cloud in clouds]),
        towards=towards,
        centre=centre,
        extent=extent,
        floor=lowest - pad if lowest < -0.1 * reach else 0.0,
        reach=reach,
        planar=normal is not None,
    )
