"""A playground: one page, without a network, that simulates again as a slider moves."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.files import put_text
from fpid_pin.simulation.entry import simulate
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.view import playground_settings as settings
from fpid_pin.view.camera import stage
from fpid_pin.view.document import as_text, asset, closed, document
from fpid_pin.view.page import licences, meshcat_file
from fpid_pin.view.playground_engine import Engine, require_playable, supervisor_of
from fpid_pin.view.playground_presets import presets
from fpid_pin.view.scene import still_scene, to_script_json

#: Points of a curve: two for each of so many spans of time.
SHOWN = 1200
_SCRIPTS = (
    "playground_settings", "playground_plots", "playground_scene", "bodies", "playground_controls",
    "playground",
)  # fmt: skip


class Playground:
    """A page that is there: its text, and where it was written.

    In a notebook it shows itself.
    """

    def __init__(self, text: str, path: Path | None) -> None:
        self.text, self.path = text, path

    def __repr__(self) -> str:
        where = "not written" if self.path is None else str(self.path)
        return f"Playground({where}, {len(self.text.encode()) / 1e6:.2f} MB)"

    def _repr_html_(self) -> str:
        """Return the page in a frame of its own, shut off from the notebook around it."""
        return (
            '<iframe title="playground" sandbox="allow-scripts allow-downloads allow-modals" '
            'style="width: 100%; height: 820px; border: 1px solid #8884; border-radius: 8px" '
            f'srcdoc="{escape(self.text)}"></iframe>'
        )


def playground(
    experiment: Experiment,
    controllers: Controller | Sequence[Controller],
    path: str | Path | None = None,
    *,
    title: str = "",
) -> Playground:
    """Make a page with sliders for everything that a run depends on; each move simulates again.

    The page holds the compiled kernels as JavaScript: its run is that of
    ``dynamics="compiled"`` within rounding. It needs no server and asks for nothing.

    Parameters
    ----------
    experiment
        Where the sliders begin.
    controllers
        One or several `AdaptiveFpid` of one design with shared poles; a choice on the page.
    path
        The file; it appears whole or not at all. None: for a notebook, nothing is written.
    title
        Of the page; empty: the arm's name.

    Returns
    -------
    Playground

    Raises
    ------
    ArgumentError, ArmError, DesignError
        What the page cannot hold: another law, integrator or disturbance, CRONE's poles, an arm
        with other joints than revolute and prismatic ones.
    """
    text = playground_html(experiment, controllers, title=title)
    if path is None:
        return Playground(text, None)
    return Playground(text, put_text(path, text))


def playground_html(
    experiment: Experiment, controllers: Controller | Sequence[Controller], *, title: str = ""
) -> str:
    """Return the text of the page that `playground` makes."""
    checks.instance("experiment", experiment, Experiment, "an Experiment")
    laws: list[AdaptiveFpid] = []
    for c in [controllers] if isinstance(controllers, Controller) else controllers:
        laws.append(require_playable(c, experiment, laws))
    if not laws:
        raise ArgumentError("controllers", "at least one controller", "none")
    if experiment.integrator != "semi_implicit_euler":
        raise ArgumentError("integrator", "semi_implicit_euler in a page", experiment.integrator)
    steps = settings.steps_of(experiment)
    engine = Engine(experiment, laws, steps)
    starts = [settings.start_settings(experiment, c, k) for k, c in enumerate(laws)]
    shown = engine.table() | settings.outside(experiment) | {"shown": SHOWN}
    title = title or f"{experiment.arm.name}, adaptive fractional PID"
    outside = to_script_json({key: shown[key] for key in ("duration", "shown", "disturbance")})
    return document(
        title,
        style=asset("uPlot.min.css") + asset("playground.css"),
        body=_BODY.format(title=as_text(title), engine=_worker(engine, shown)),
        scripts=[
            meshcat_file("dist/main.min.js"),
            asset("uPlot.iife.min.js"),
            f"const SCENE = {to_script_json(_scene(experiment))}, ENGINE = {outside}, "
            f"PAGE = {to_script_json(_page(experiment, laws, starts, steps, title))};",
            *(asset(f"{name}.js") for name in _SCRIPTS),
        ],
        comment=licences(_credits(experiment)) + _uplot_licence(),
    )


def _credits(e: Experiment) -> list[str]:
    return [e.arm.credit] if e.arm.credit else []


def _uplot_licence() -> str:
    return "\nThe plots are drawn by uPlot (github.com/leeoniya/uPlot):\n" + asset(
        "uPlot.LICENSE.txt"
    )


def _worker(engine: Engine, table: dict[str, Any]) -> str:
    parts = [
        f"const E = {to_script_json(table)};\nconst M = new Float64Array(E.words);\n"
        f"const K = (() => {{\n{engine.text}}})();\n",
        *(asset(f"playground_{name}.js") for name in ("noise", "engine", "worker")),
    ]
    return closed("".join(parts))


def _scene(e: Experiment) -> dict[str, Any]:
    """Return the table of the arm alone, looked at from where its reference fits in."""
    t = np.linspace(0.0, e.duration, 240)
    motion = np.concatenate([e.motion(t)[0], [np.asarray(e.q0)]])
    return still_scene([e.arm], [e.arm.name], stage([e.arm], [motion]))


def _page(
    e: Experiment, laws: list[AdaptiveFpid], starts: list[dict[str, Any]], steps: list[float],
    title: str,
) -> dict[str, Any]:  # fmt: skip
    notes: list[str] = []
    with warnings.catch_warnings():
        # What the description has to say about limits it said when it was made.
        warnings.simplefilter("ignore", FpidWarning)
        alone = replace(laws[0], supervisor=None)
        run = simulate(replace(e, dynamics="compiled"), alone)
    need = np.abs(plant_of(e).arm.gravity_vector(np.asarray(e.q0)))
    peak = np.maximum(np.abs(run.torque).max(axis=0) if len(run.t) else need, 0.1)
    return {
        "title": title,
        "joints": list(e.arm.joint_names),
        "names": [law.name or f"adaptive FPID {k + 1}" for k, law in enumerate(laws)],
        "starts": starts,
        "steps": steps,
        "groups": settings.control_groups(e, laws, starts),
        "presets": presets(
            e, starts[0], steps, [float(x) for x in peak],
            supervisor_of(e, laws[0]).reference_bound, supervisor_of(e, laws[0]).kind,
        ),
        "toml": settings.toml_tables(e, laws),
        "notes": notes,
    }  # fmt: skip


# The engine is no script of the page, but the text that its worker is made from.
_BODY = """<header><h1>{title}</h1>
<label id="laws">Controller <select id="controller"></select></label>
<label>Preset <select id="preset"><option value="">choose …</option></select></label>
<div class="tools"><button id="undo" type="button">Undo</button>
<button id="redo" type="button">Redo</button><button id="reset" type="button">Reset</button>
<button id="pin" type="button">Pin this run</button>
<button id="unpin" type="button" hidden>Unpin</button><button id="link" type="button">Link</button>
<button id="toml" type="button">Copy TOML</button></div></header>
<p id="message" role="status" hidden></p>
<main>
<section id="views" aria-label="What the run does">
<div id="tabs" role="tablist" aria-label="View">
<button role="tab" data-view="error" aria-controls="error" type="button">Error</button>
<button role="tab" data-view="torque" aria-controls="torque" type="button">Torque</button>
<button role="tab" data-view="gains" aria-controls="gains" type="button">Gains</button>
<button role="tab" data-view="arm" aria-controls="arm" type="button">Arm</button>
<button role="tab" data-view="table" aria-controls="table" type="button">Table</button></div>
<div id="bar"><p id="outcome" role="status" aria-live="polite">Starting …</p>
<label><span>Show</span> <select id="joint" aria-label="Joints shown"></select></label>
<div id="legend"><span class="key dashed"><i></i>pinned</span></div></div>
<section class="card" id="arm" aria-label="The arm"><div id="stage" role="img"
 aria-label="The arm in three dimensions; translucent green: where it should be"></div>
<div id="clock"><button id="play" type="button">Play</button>
<input id="seek" type="range" min="0" max="1" step="any" value="0" aria-label="time">
<output id="time">0.00 s</output></div></section>
<section class="card" id="error"><h2>Error <small>rad</small></h2>
<div class="plot" id="plot-error"></div></section>
<section class="card" id="torque"><h2>Torque <small>N m, after the drives' limits</small></h2>
<div class="plot" id="plot-torque"></div></section>
<section class="card" id="gains"><h2>Gains <select id="gain" aria-label="Which gain or order">
<option value="kp">Kp</option><option value="ki">Ki</option><option value="kd">Kd</option>
<option value="integral_order">λ</option><option value="derivative_order">μ</option></select></h2>
<div class="plot" id="plot-gains"></div></section>
<section class="card" id="table"><table><caption hidden>Metrics</caption><thead><tr>
<th scope="col">the smaller the better</th><th scope="col">now</th><th scope="col">pinned</th>
<th scope="col">change</th></tr></thead><tbody id="metrics"></tbody></table></section>
</section>
<section id="controls" aria-label="Settings"></section>
</main>
<dialog id="giving" aria-labelledby="giving-head"><h2 id="giving-head">TOML</h2>
<textarea id="given" readonly aria-label="Text to copy" spellcheck="false"></textarea>
<div class="tools"><button id="copy" type="button">Copy</button>
<button id="save" type="button">Save as file</button><button id="close" type="button">Close</button>
<span id="copied" role="status"></span></div></dialog>
<script type="text/plain" id="engine">{engine}</script>"""
