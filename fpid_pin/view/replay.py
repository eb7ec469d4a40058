"""Runs as one page that opens anywhere: in a file, in a browser, in the cell of a notebook."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import FpidError
from fpid_pin.files import put_text
from fpid_pin.simulation.run import Run
from fpid_pin.text import cut
from fpid_pin.view.document import Page, as_text, asset, document
from fpid_pin.view.link import LiveLink
from fpid_pin.view.scene import as_runs, captions_of, replay_scene, to_script_json

_BODY = """<div id="stage"></div>
<details id="panel" open><summary>{title}</summary><div id="runs"></div>
<p id="legend"></p></details>
<div id="message" role="alert" hidden></div>
<div id="clock"><button id="play" type="button" >Pause</button>
<input id="seek" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="time">t = 0.00 s</output></div>
<script type="application/json" id="scene">{scene}</script>"""

_SCRIPTS = ("scene.js", "bodies.js", "stage.js", "replay.js")


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
    """Return the whole page of a table from `fpid_pin.view.scene`; it asks for nothing."""
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
