"""A scene as one table of plain values, which pages draw from: arms, their motion, camera."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.parts import PRISMATIC
from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, visible
from fpid_pin.view.shapes import Shape, joint_axis, shapes_of, tool_placement
from fpid_pin.view.style import colour

if TYPE_CHECKING:
    from fpid_pin.simulation.experiment import Experiment
    from fpid_pin.simulation.run import Run

#: Characters of a caption or a joint's name: what a picture has room for.
_CAPTION = 80
#: Poses of a motion that the camera is fitted to.
_POSES = 120
_UP = np.array((0.0, 0.0, 1.0))

# ------------------------------------------------------------------ runs


def as_runs(runs: Run | Sequence[Run]) -> list[Run]:
    """Return a list whether one run or several are given."""
    return list(runs) if isinstance(runs, Sequence) else [runs]


def captions_of(runs: Sequence[Run], captions: Sequence[str] | None) -> list[str]:
    """Return one caption a run: those given, else the runs' names, told apart by number."""
    if captions is not None:
        texts = [captions] if isinstance(captions, str) else [str(text) for text in captions]
        if len(texts) != len(runs):
            raise ArgumentError("captions", f"{len(runs)} (one a run)", f"{len(texts)}")
        return [_short(text) for text in texts]
    names = [_short(run.name) for run in runs]
    return [
        name if names.count(name) == 1 else f"{name} ({names[:k].count(name) + 1})"
        for k, name in enumerate(names)
    ]


def _short(text: str) -> str:
    return cut(visible(text), _CAPTION)


def replay_scene(
    runs: Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    groups: Mapping[str, Sequence[int]] | None = None,
) -> dict[str, Any]:
    """Return the scene of a replay of runs, side by side, with `fps` frames a second.

    `groups` are runs that are seen together, by name, as indices, None: all; the first is shown.
    A run's colour is that of its place in its group.
    """
    fps = checks.number("fps", fps, low=1.0, high=240.0)
    if not runs:
        raise ArgumentError("runs", "at least one run", "none")
    texts = captions_of(runs, captions)
    for run, text in zip(runs, texts, strict=True):
        if len(run.t) == 0:
            raise ArgumentError("run", "at least one sample", f"none in {text!r}")
        if not (np.isfinite(run.q).all() and np.isfinite(run.q_ref).all()):
            # A file may say so; the engine ends a run before.
            raise ArgumentError("run", "finite angles", f"NaN or inf in {text!r}")
    scene, table = _Scene(), []
    for name, members in (groups or {"": range(len(runs))}).items():
        seen = [_frames(runs[k], fps) for k in members]
        motions = [np.concatenate([frames["q"], frames["q_ref"]]) for frames in seen]
        group = scene.group([runs[k].arm for k in members], [texts[k] for k in members], motions)
        for entry, frames, k in zip(group["runs"], seen, members, strict=True):
            entry |= {key: scene.store(values.astype("f4")) for key, values in frames.items()}
            if not runs[k].outcome.completed:
                entry["outcome"] = visible(str(runs[k].outcome))
        group["duration"] = max(float(runs[k].t[-1]) for k in members)
        table.append({"name": _short(name), **group})
    return {"shown": 0, "groups": table, "live": False, **scene.table()}


def _frames(run: Run, fps: float) -> dict[str, FloatArray]:
    """Return samples of a run, some `fps` a second, the last one among them."""
    last, stride = len(run.t) - 1, max(round(1.0 / (fps * run.step)), 1)
    rows = np.append(np.arange(0, last, stride), last)
    return {key: getattr(run, key)[rows] for key in ("t", "q", "q_ref", "torque")}


def experiment_scene(experiment: Experiment, caption: str, span: float) -> dict[str, Any]:
    """Return a scene without motion: an experiment's arm, with room for `span` [s] of it."""
    wanted = experiment.motion(np.linspace(0.0, span, 240))[0]
    motion = np.concatenate([np.asarray(experiment.q0).reshape(1, -1), wanted])
    scene = _Scene()
    return scene.group([experiment.arm], [caption], [motion]) | scene.table()


# ------------------------------------------------------------------ the table


class _Scene:
    """Arms on their way into a table: those that are equal are described once, as are buffers."""

    def __init__(self) -> None:
        self._arms: list[Arm] = []
        self._described: list[dict[str, Any]] = []
        self._buffers: list[dict[str, str]] = []

    def store(self, array: NDArray[Any]) -> int:
        """Store a float32, uint16 or uint32 array and return its number."""
        little = array.astype(array.dtype.newbyteorder("<"))
        data = base64.b64encode(little.tobytes()).decode("ascii")
        self._buffers.append({"type": little.dtype.str[1:], "data": data})
        return len(self._buffers) - 1

    def table(self) -> dict[str, Any]:
        """Return what does not depend on who is on the stage."""
        credits = sorted({arm.credit for arm in self._arms if arm.credit})
        return {"arms": self._described, "buffers": self._buffers, "credits": credits}

    def group(
        self, arms: list[Arm], captions: Sequence[str], motions: list[FloatArray]
    ) -> dict[str, Any]:
        """Return who is on the stage, and where it is seen from; for `motions` see `stage`."""
        place = stage(arms, motions)
        runs = [
            {"caption": _short(caption), "arm": self._number(arm), "offset": place.offsets[k],
             "top": place.heights[k], "colour": colour(k)}
            for k, (arm, caption) in enumerate(zip(arms, captions, strict=True))
        ]  # fmt: skip
        camera = {name: getattr(place, name) for name in ("towards", "centre", "extent")}
        about = {name: getattr(place, name) for name in ("floor", "reach", "planar")}
        return {"runs": runs, "camera": camera, **about}

    def _number(self, arm: Arm) -> int:
        if arm not in self._arms:
            self._arms.append(arm)
            self._described.append(self._arm(arm))
        return self._arms.index(arm)

    def _arm(self, arm: Arm) -> dict[str, Any]:
        joints = [
            {"name": _short(arm.joint_names[j]), "axis": joint_axis(arm.model, j),
             "placement": _column_major(arm.model.jointPlacements[j + 1].homogeneous),
             "slides": arm.joint_kinds[j] == PRISMATIC,
             "limit": limit if np.isfinite(limit) else None}
            for j, limit in enumerate(arm.effort_limit)
        ]  # fmt: skip
        joint, placement = tool_placement(arm)
        return {
            "name": _short(arm.name), "joints": joints,
            "tool": {"joint": joint, "placement": _column_major(placement)},
            "shapes": [self._shape(shape) for shape in shapes_of(arm)],
        }  # fmt: skip

    def _shape(self, shape: Shape) -> dict[str, Any]:
        # 16 bits over the shape's own box: 8 um on a link of half a metre, at half the size.
        steps = np.iinfo(np.uint16).max
        low = shape.vertices.min(axis=0)
        scale = np.maximum(shape.vertices.max(axis=0) - low, 1e-9) / steps
        grid = np.rint((shape.vertices - low) / scale).astype(np.uint16)
        index = shape.triangles.astype(np.uint16 if len(grid) <= steps else np.uint32)
        return {
            "joint": shape.joint, "placement": _column_major(shape.placement),
            "colour": shape.colour, "low": low, "scale": scale, "vertices": self.store(grid),
            "triangles": self.store(index),
        }  # fmt: skip


def _column_major(matrix: NDArray[Any]) -> NDArray[Any]:
    return matrix.T.ravel()


def to_script_json(table: Any) -> str:
    """Return JSON, of plain values and arrays, that may stand inside a script element."""
    text = json.dumps(table, allow_nan=False, separators=(",", ":"), default=np.ndarray.tolist)
    for sign in ("<", ">", "&", "\u2028", "\u2029"):
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text


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
