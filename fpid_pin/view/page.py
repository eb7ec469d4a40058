"""The page that shows a scene: meshcat's viewer, our script and the scene, all in one text."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from html import escape
from importlib import resources, util
from pathlib import Path
from typing import Any

from fpid_pin.exceptions import FpidError
from fpid_pin.view.scene import to_script_json

# Nothing may be fetched: whatever a run's file says, the page cannot call home.
SEALED = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; worker-src blob:; base-uri 'none'; form-action 'none'"
)
_LIVE = SEALED + "; connect-src ws://127.0.0.1:* ws://localhost:*"

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<title>{title}</title>
<link rel="icon" href="data:,">
<style>{style}</style>
<!--
{licences}
-->
</head>
<body>
<div id="meshcat-pane"></div>
<details id="panel" open><summary>{title}</summary><div id="runs"></div>
<p id="legend"></p></details>
<div id="message" role="alert" hidden></div>
<div id="clock"><button id="play" type="button" >Pause</button>
<input id="seek" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="time">t = 0.00 s</output></div>
<script>{meshcat}</script>
<script>const SCENE = {scene};</script>
<script>{bodies}</script>
<script>{replay}</script>
</body>
</html>
"""


@cache
def asset(name: str) -> str:
    """Return the text of a file of this room's assets."""
    return (resources.files("fpid_pin.view") / "assets" / name).read_text(encoding="utf-8")


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
    """Return who made what is embedded in a page, fit for an HTML comment."""
    text = "\n".join(
        [
            "This page embeds MeshCat (github.com/meshcat-dev/meshcat):",
            meshcat_file("LICENSE"),
            "and, within it,",
            meshcat_file("dist/main.min.js.LICENSE.txt"),
            *(f"Robot description: {credit}" for credit in credits),
        ]
    )
    return text.replace("--", "- -").replace(">", "")


def render(scene: Mapping[str, Any], title: str) -> str:
    """Return the whole page as text; it makes no request to anywhere.

    Parameters
    ----------
    scene
        From `fpid_pin.view.scene`.
    title
        Plain text.
    """
    return _PAGE.format(
        policy=_LIVE if scene["live"] else SEALED,
        title=escape(title),
        style=asset("replay.css"),
        licences=licences(scene["credits"]),
        meshcat=meshcat_file("dist/main.min.js").replace("</script", "<\\/script"),
        scene=to_script_json(scene),
        bodies=asset("bodies.js"),
        replay=asset("replay.js"),
    )
