"""A playground: one page, without a network, that simulates again as a slider moves."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from string import Template
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
from fpid_pin.view.playground_engine import Engine
from fpid_pin.view.playground_law import Law, supervisor_of
from fpid_pin.view.playground_presets import presets
from fpid_pin.view.replay import licences, meshcat_file
from fpid_pin.view.scene import still_scene, to_script_json

#: Points of a curve: two for each of so many spans of time.
SHOWN = 1200
#: What the page calls numbers of a law.
_SIGNALS = {
    "kp": "Kp", "ki": "Ki", "kd": "Kd", "integral_order": "λ", "derivative_order": "μ",
    "u_law": "torque of the law itself [N m]", "u_model": "torque by the model [N m]",
    "u_s": "torque of the supervisor [N m]",
}  # fmt: skip
_SCRIPTS = (
    "bodies", "stage", "playground_settings", "playground_plots", "playground_scene",
    "playground_controls", "playground",
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
        Laws by their functions (`Controller`'s first two forms), one or several, whose fractional
        operators are of one design with shared poles. Several can be on the plots at once; a law
        of one's own has a slider for each field that is a number.
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
        What the page cannot hold: a law in plain Python, another integrator or disturbance,
        CRONE's poles, an arm with other joints than revolute and prismatic ones.
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
    laws: list[Law] = []
    for controller in [controllers] if isinstance(controllers, Controller) else controllers:
        laws.append(Law(controller, experiment, laws))
    if not laws:
        raise ArgumentError("controllers", "at least one controller", "none")
    if experiment.integrator != "semi_implicit_euler":
        raise ArgumentError("integrator", "semi_implicit_euler in a page", experiment.integrator)
    steps = settings.steps_of(experiment, laws)
    engine = Engine(experiment, laws, steps)
    shown = engine.table() | settings.outside(experiment) | {"shown": SHOWN}
    names = _names(laws)
    what = names[0] if len(names) == 1 else f"{len(names)} controllers"
    title = title or f"{experiment.arm.name}, {what}"
    outside = to_script_json({key: shown[key] for key in ("duration", "shown", "disturbance")})
    page = to_script_json(_page(experiment, laws, steps, title))
    body = Template(asset("playground.html"))
    return document(
        title,
        style=asset("uPlot.min.css") + asset("playground.css"),
        body=body.substitute(title=as_text(title), engine=_worker(engine, shown)),
        scripts=[
            meshcat_file("dist/main.min.js"),
            asset("uPlot.iife.min.js"),
            f"const SCENE = {to_script_json(_scene(experiment))}, ENGINE = {outside}, "
            f"PAGE = {page};",
            *(asset(f"{name}.js") for name in _SCRIPTS),
        ],
        comment=licences([experiment.arm.credit] if experiment.arm.credit else [])
        + "\nThe plots are drawn by uPlot (github.com/leeoniya/uPlot):\n"
        + asset("uPlot.LICENSE.txt"),
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


def _names(laws: Sequence[Law]) -> list[str]:
    """Return what the page calls the laws: by name, or by kind and number."""
    found: list[str] = []
    for law in laws:
        kind = "adaptive FPID" if isinstance(law.controller, AdaptiveFpid) else ""
        name = law.controller.name or kind or type(law.controller).__name__
        found.append(f"{name} {len(found) + 1}" if name in found else name)
    return found


def _page(e: Experiment, laws: Sequence[Law], steps: list[float], title: str) -> dict[str, Any]:
    alone = replace(laws[0].controller, supervisor=None)
    with warnings.catch_warnings():
        # What the description has to say about limits it said when it was made.
        warnings.simplefilter("ignore", FpidWarning)
        run = simulate(replace(e, dynamics="compiled"), alone)
    need = np.abs(plant_of(e).arm.gravity_vector(np.asarray(e.q0)))
    peak = np.maximum(np.abs(run.torque).max(axis=0) if len(run.t) else need, 0.1)
    start, names = settings.start_settings(e, laws), _names(laws)
    return {
        "title": title,
        "joints": list(e.arm.joint_names),
        "start": start,
        "steps": steps,
        "laws": [_law(e, law, name) for law, name in zip(laws, names, strict=True)],
        "groups": settings.shared_groups(e, start),
        "presets": presets(e, laws, steps, peak.tolist()),
        "toml": settings.toml_tables(e, laws, names),
    }


def _law(e: Experiment, law: Law, name: str) -> dict[str, Any]:
    """Return what the page has to know of a law beside its engine."""
    operators = law.state.controller.operators.values()
    return {
        "name": name,
        "fpid": isinstance(law.controller, AdaptiveFpid),
        "groups": settings.law_groups(e, law),
        "orders": [x.order for x in operators if isinstance(x.order, str)],
        "bound": settings.tidy(supervisor_of(e, law.controller).reference_bound * 1.0001),
        "signals": [[signal, _SIGNALS.get(signal, signal)] for signal in law.signals],
    }
