"""Runs as one page that opens anywhere: in a file, in a browser, in the cell of a notebook.

A page draws from a scene: one table of plain values with the arms, their motion and the camera.
"""

import base64
import contextlib
import json
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.arms.parts import PRISMATIC
from fpid_pin.checks import FloatArray, checked
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.files import put_text
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.run import Run
from fpid_pin.text import cut, visible
from fpid_pin.view.document import Page, as_text, asset, document
from fpid_pin.view.link import LiveLink
from fpid_pin.view.shapes import Shape, joint_axis, shapes_of, stage, tool_placement
from fpid_pin.view.style import as_runs, captions_of, colour, short

_BODY = """<div id="stage"></div>
<details id="panel" open><summary>{title}</summary><div id="runs"></div>
<p id="legend"></p></details>
<div id="message" role="alert" hidden></div>
<div id="clock"><button id="play" type="button" >Pause</button>
<input id="seek" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="time">t = 0.00 s</output></div>
<script type="application/json" id="scene">{scene}</script>"""

_SCRIPTS = ("scene.js", "replay.js")

# ------------------------------------------------------------------ the scene


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
        table.append({"name": short(name), **group})
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
            {"caption": short(caption), "arm": self._number(arm), "offset": place.offsets[k],
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
            {"name": short(arm.joint_names[j]), "axis": joint_axis(arm.model, j),
             "placement": _column_major(arm.model.jointPlacements[j + 1].homogeneous),
             "slides": arm.joint_kinds[j] == PRISMATIC,
             "limit": limit if np.isfinite(limit) else None}
            for j, limit in enumerate(arm.effort_limit)
        ]  # fmt: skip
        joint, placement = tool_placement(arm)
        return {
            "name": short(arm.name), "joints": joints,
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


# ------------------------------------------------------------------ the page


@cache
def meshcat_file(name: str) -> str:
    """Read a file of meshcat's viewer without importing meshcat, which starts much else."""
    spec = util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FpidError("expected the package meshcat, got none (pip install meshcat)")
    return (Path(spec.origin).parent / "viewer" / name).read_text(encoding="utf-8")


def licences(credits: Sequence[str]) -> str:
    """Return who made what is embedded in a page."""
    return "\n".join([
        "This page embeds MeshCat (github.com/meshcat-dev/meshcat):", meshcat_file("LICENSE"),
        "and, within it,", meshcat_file("dist/main.min.js.LICENSE.txt"),
        *(f"Robot description: {credit}" for credit in credits),
    ])  # fmt: skip


def render(scene: Mapping[str, Any], title: str) -> str:
    """Return the whole page of a scene; it asks for nothing."""
    return document(
        title,
        style=asset("replay.css"),
        body=_BODY.format(title=as_text(cut(title)), scene=to_script_json(scene)),
        scripts=[meshcat_file("dist/main.min.js"), *map(asset, _SCRIPTS)],
        comment=licences(scene["credits"]),
        live=scene["live"],
    )


def replay_html(
    runs: Run | Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    title: str | None = None,
    groups: Mapping[str, Sequence[int]] | None = None,
) -> str:
    """Return the page that `export_html` writes; of several `groups` it shows the first."""
    several = as_runs(runs)
    scene = replay_scene(several, captions=captions, fps=fps, groups=groups)
    return render(scene, title or " / ".join(captions_of(several, captions)))


@checked
def export_html(
    runs: Run | Sequence[Run],
    path: str | Path,
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    title: str | None = None,
) -> Path:
    """Write runs as one self-contained page, played with meshcat's time slider.

    The arm, its desired self as a ghost, the tool's paths and the joint torques against their
    limits; several runs stand side by side under their captions.

    Parameters
    ----------
    runs
        A run, or several.
    path
        The file; it appears whole or not at all.
    captions
        One a run; None: the runs' names.
    fps
        Samples of the motion a second, 1 to 240; what is between is interpolated.
    title
        Of the page; None: the captions.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        No runs, not one caption a run, `fps` out of range.
    FileFormatError
        The file cannot be written.
    """
    return put_text(path, replay_html(runs, captions=captions, fps=fps, title=title))


@checked
def play(
    runs: Run | Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    open_browser: bool = True,
    port: int | None = None,
    announce: Callable[[str], None] | None = None,
) -> None:
    """Show runs in a browser: the page of `export_html`, without a file.

    The page is served on 127.0.0.1, once: as soon as a browser has it, or on Ctrl-C, this returns.

    Parameters
    ----------
    runs, captions, fps
        As for `export_html`.
    open_browser
        Whether to open the page, or only to say where it is.
    port
        First port to try; None: 7000.
    announce
        Told what the user needs to know; None: the package's logger.

    Raises
    ------
    ArgumentError
        As `export_html` does, or `port` out of range.
    FpidError
        The server did not start, or was ended by someone else.
    """
    page = replay_html(runs, captions=captions, fps=fps)
    with (
        contextlib.suppress(KeyboardInterrupt),
        LiveLink(page, port=port, announce=announce) as link,
    ):
        link.show(open_browser)
        while not link.served:
            link.send(0.0, [])
            time.sleep(0.05)
            if not link.alive:
                raise FpidError("live view: its server was ended from outside")


@checked
def show(
    runs: Run | Sequence[Run],
    *,
    captions: Sequence[str] | None = None,
    fps: float = 30.0,
    height: int = 520,
) -> Page:
    """Return the replay of runs for a notebook: the last line of a cell shows it.

    Parameters
    ----------
    runs, captions, fps
        As for `export_html`; the same page, which takes some 1 MB in the notebook.
    height
        Of the frame [pixels].

    Raises
    ------
    ArgumentError
        As `export_html` does.
    """
    count = len(as_runs(runs))
    kind = f"Replay of {count} run{'s' * (count > 1)}"
    return Page(replay_html(runs, captions=captions, fps=fps), kind, height)
