"""A replay as one table of plain values: arms, their motion, camera; what the page draws from."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.joints import PRISMATIC
from fpid_pin.exceptions import ArgumentError
from fpid_pin.text import cut, visible
from fpid_pin.view.camera import Stage, stage
from fpid_pin.view.shapes import Shape, joint_axis, shapes_of, tool_placement
from fpid_pin.view.style import colour

if TYPE_CHECKING:
    from fpid_pin.simulation.experiment import Experiment
    from fpid_pin.simulation.run import Run

_STEPS = 65535
#: Characters of a caption or a joint's name: what a picture has room for.
_CAPTION = 80


class Buffers:
    """Arrays on their way into a text: each becomes a number, and is written once."""

    def __init__(self) -> None:
        self.table: list[dict[str, str]] = []

    def add(self, array: NDArray[Any]) -> int:
        """Store a float32, uint16 or uint32 array and return its number."""
        little = array.astype(array.dtype.newbyteorder("<"))
        data = base64.b64encode(little.tobytes()).decode("ascii")
        self.table.append({"type": little.dtype.str[1:], "data": data})
        return len(self.table) - 1


def frames_of(run: Run, fps: float) -> NDArray[np.int64]:
    """Return which samples of a run make about `fps` frames a second, the last one among them."""
    last, stride = len(run.t) - 1, max(round(1.0 / (fps * run.step)), 1)
    return np.append(np.arange(0, last, stride), last)


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
    """Return the table of a replay of one or several runs, side by side.

    Parameters
    ----------
    runs, captions, fps
        See `export_html`.
    groups
        What is seen together, by name, as indices of runs; the first is shown. A run's colour is
        that of its place in its group. None: all.

    Raises
    ------
    ArgumentError
        No runs, a run without samples, not one caption a run, or `fps` out of range.
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
    frames = [frames_of(run, fps) for run in runs]
    arms = [run.arm for run in runs]
    cast = SceneArms(arms)
    table = []
    for name, members in (groups or {"": range(len(runs))}).items():
        motions = [
            np.concatenate([runs[k].q[frames[k]], runs[k].q_ref[frames[k]]]) for k in members
        ]
        place = stage([arms[k] for k in members], motions)
        group = cast.group([arms[k] for k in members], [texts[k] for k in members], place)
        for entry, k in zip(group["runs"], members, strict=True):
            for key in ("t", "q", "q_ref", "torque"):
                values = getattr(runs[k], key)[frames[k]].astype(np.float32)
                entry[key] = cast.buffers.add(values)
            if not runs[k].outcome.completed:
                entry["outcome"] = visible(str(runs[k].outcome))
        group["duration"] = max(float(runs[k].t[-1]) for k in members)
        table.append({"name": _short(name), **group})
    return {"shown": 0, "groups": table, "live": False, **cast.table()}


def experiment_scene(experiment: Experiment, caption: str, span: float) -> dict[str, Any]:
    """Return a scene without motion: an experiment's arm, with room for `span` [s] of it."""
    arm = experiment.arm
    motion = experiment.motion(np.linspace(0.0, span, 240))[0]
    motion = np.concatenate([np.asarray(experiment.q0).reshape(1, -1), motion])
    arms = SceneArms([arm])
    return arms.group([arm], [caption], stage([arm], [motion])) | arms.table()


class SceneArms:
    """The arms of a scene; those that are equal are described once."""

    def __init__(self, arms: Sequence[Arm]) -> None:
        self.buffers = Buffers()
        self._known: list[Arm] = []
        for arm in arms:
            if arm not in self._known:
                self._known.append(arm)
        self._described = [_arm_table(arm, self.buffers) for arm in self._known]

    def table(self) -> dict[str, Any]:
        """Return what does not depend on who is on the stage."""
        return {
            "arms": self._described,
            "buffers": self.buffers.table,
            "credits": sorted({arm.credit for arm in self._known if arm.credit}),
        }

    def group(self, arms: Sequence[Arm], captions: Sequence[str], place: Stage) -> dict[str, Any]:
        """Return who is on the stage, and where it is seen from."""
        runs = [
            {
                "caption": _short(caption),
                "arm": self._known.index(arm),
                "offset": place.offsets[k],
                "top": place.heights[k],
                "colour": colour(k),
            }
            for k, (arm, caption) in enumerate(zip(arms, captions, strict=True))
        ]
        camera = {name: getattr(place, name) for name in ("towards", "centre", "extent")}
        about = {name: getattr(place, name) for name in ("floor", "reach", "planar")}
        return {"runs": runs, "camera": camera, **about}


def _arm_table(arm: Arm, buffers: Buffers) -> dict[str, Any]:
    joints = [
        {
            "name": _short(arm.joint_names[j]),
            "placement": _column_major(arm.model.jointPlacements[j + 1].homogeneous),
            "axis": joint_axis(arm.model, j),
            "slides": arm.joint_kinds[j] == PRISMATIC,
            "limit": limit if np.isfinite(limit) else None,
        }
        for j, limit in enumerate(arm.effort_limit)
    ]
    joint, placement = tool_placement(arm)
    return {
        "name": _short(arm.name),
        "joints": joints,
        "tool": {"joint": joint, "placement": _column_major(placement)},
        "shapes": [_shape_table(shape, buffers) for shape in shapes_of(arm)],
    }


def _shape_table(shape: Shape, buffers: Buffers) -> dict[str, Any]:
    # 16 bits over the shape's own box: 8 um on a link of half a metre, at half the size.
    low = shape.vertices.min(axis=0)
    scale = np.maximum(shape.vertices.max(axis=0) - low, 1e-9) / _STEPS
    grid = np.rint((shape.vertices - low) / scale).astype(np.uint16)
    return {
        "joint": shape.joint,
        "placement": _column_major(shape.placement),
        "colour": shape.colour,
        "low": low,
        "scale": scale,
        "vertices": buffers.add(grid),
        "triangles": buffers.add(
            shape.triangles.astype(np.uint16 if len(grid) <= _STEPS else np.uint32)
        ),
    }


def _column_major(matrix: NDArray[Any]) -> NDArray[Any]:
    return matrix.T.ravel()


def to_script_json(table: Any) -> str:
    """Return JSON, of plain values and arrays, that may stand inside a script element."""
    text = json.dumps(table, allow_nan=False, separators=(",", ":"), default=np.ndarray.tolist)
    for sign in ("<", ">", "&", "\u2028", "\u2029"):
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text
