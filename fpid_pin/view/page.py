"""The page that shows a scene: meshcat's viewer, our script and the scene, all in one text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from importlib import util
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import FpidError
from fpid_pin.text import cut
from fpid_pin.view.document import as_text, asset, document
from fpid_pin.view.scene import to_script_json

_BODY = """<div id="meshcat-pane"></div>
<details id="panel" open><summary>{title}</summary><div id="runs"></div>
<p id="legend"></p></details>
<div id="message" role="alert" hidden></div>
<div id="clock"><button id="play" type="button" >Pause</button>
<input id="seek" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="time">t = 0.00 s</output></div>
<script type="application/json" id="scene">{scene}</script>"""


@cache
def meshcat_file(name: str) -> str:
    """Read a file of meshcat's viewer without importing meshcat, which starts much else."""
    spec = util.find_spec("meshcat")
    if spec is None or spec.origin is None:
        raise FpidError("expected the package meshcat, got none (pip install meshcat)")
    path = Path(spec.origin).parent / "viewer" / name
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise FpidError(f"meshcat's viewer: {path}: {error.strerror}") from None


def licences(credits: list[str]) -> str:
    """Return who made what is embedded in a page."""
    return "\n".join(
        [
            "This page embeds MeshCat (github.com/meshcat-dev/meshcat):",
            meshcat_file("LICENSE"),
            "and, within it,",
            meshcat_file("dist/main.min.js.LICENSE.txt"),
            *(f"Robot description: {credit}" for credit in credits),
        ]
    )


def render(scene: Mapping[str, Any], title: str) -> str:
    """Return the whole page as text; it makes no request to anywhere.

    Parameters
    ----------
    scene
        From `fpid_pin.view.scene`.
    title
        Plain text.
    """
    return document(
        title,
        style=asset("replay.css"),
        body=_BODY.format(title=as_text(cut(title)), scene=to_script_json(scene)),
        scripts=[
            meshcat_file("dist/main.min.js"),
            asset("scene.js"),
            asset("bodies.js"),
            asset("replay.js"),
        ],
        comment=licences(scene["credits"]),
        live=scene["live"],
    )
