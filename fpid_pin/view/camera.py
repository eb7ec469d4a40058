"""Where to look from: a view direction, the room to fit in, the floor, side by side places."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from fpid_pin.arms import Arm
from fpid_pin.arms.joints import PRISMATIC
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.view.shapes import joint_axis

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
    lengths = [
        np.linalg.norm(arm.model.jointPlacements[j].translation) for j in range(2, arm.n + 1)
    ]
    frame = arm.model.frames[arm.model.getFrameId(arm.tool)]
    # Half of what a prismatic joint travels lies beyond its middle.
    spans = np.where(_slides(arm), 0.5 * (arm.upper - arm.lower), 0.0)
    travel = float(spans[np.isfinite(spans)].sum())
    return max(float(sum(lengths) + np.linalg.norm(frame.placement.translation)) + travel, 1e-3)


def _slides(arm: Arm) -> BoolArray:
    return np.array([kind == PRISMATIC for kind in arm.joint_kinds])


def _planar_axis(arm: Arm) -> FloatArray | None:
    """Return the normal in the world of the plane that all joints move in, else None.

    Joints that turn do so about it, and joints that slide do so across it.
    """
    data = arm.model.createData()
    pin.forwardKinematics(arm.model, data, np.zeros(arm.n))
    axes = np.array([data.oMi[j + 1].rotation @ joint_axis(arm.model, j) for j in range(arm.n)])
    slides = _slides(arm)
    if slides.all():
        # Across all of them; where they share a line, level as well.
        if np.linalg.matrix_rank(axes) == 1:
            axes = np.vstack([axes, _UP])
        normal = np.asarray(np.linalg.svd(axes)[2][-1])
        axes = axes[: arm.n]
    else:
        normal = axes[~slides][0]
    along = np.abs(axes @ normal)
    planar = (along[~slides] > 1.0 - 1e-9).all() and (along[slides] < 1e-9).all()
    return normal if planar else None


def _side(arm: Arm, points: FloatArray) -> FloatArray:
    """Return the unit vector towards the camera for one arm that moves through `points`."""
    axis = _planar_axis(arm)
    if axis is not None and abs(axis[2]) > 0.9:
        towards = np.array((0.0, -0.35, 1.0))
    else:
        if axis is None:
            # Look across the direction in which the arm is spread out most.
            flat = points.reshape(-1, 3)[:, :2]
            flat = flat - flat.mean(axis=0)
            spread = np.linalg.eigh(flat.T @ flat)[1][:, -1]
            across, aside, above = np.array((spread[1], -spread[0], 0.0)), 0.45, 0.45
        else:
            across, aside, above = np.array((axis[0], axis[1], 0.0)), 0.18, 0.16
        across /= np.linalg.norm(across)
        # Of the two sides take the one from which +x (or else +y) is on the right.
        right = np.cross(_UP, across)
        if right[0] < -1e-6 or (abs(right[0]) <= 1e-6 and right[1] < 0.0):
            across, right = -across, -right
        towards = across + aside * right + above * _UP
    return np.asarray(towards / np.linalg.norm(towards))


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
    towards = _side(arms[0], clouds[0])
    right = np.cross(_UP, towards)
    right /= np.linalg.norm(right)
    up = np.cross(towards, right)
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
    axes = np.stack([right, up, towards])
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
        planar=_planar_axis(arms[0]) is not None,
    )
