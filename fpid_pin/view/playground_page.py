"""A playground: one page, without a network, that simulates again as a slider moves."""

import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any

from fpid_pin import checks
from fpid_pin.checks import checked
from fpid_pin.control import suggest_gains, suggest_observer
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.files import put_text
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.text import head_for, unit_for
from fpid_pin.view import playground_settings as settings
from fpid_pin.view.document import Page, as_text, asset, closed, document
from fpid_pin.view.playground_engine import Law, engine
from fpid_pin.view.replay import experiment_scene, licences, meshcat_file, to_script_json
from fpid_pin.view.style import ON_DARK, PALETTE

#: Points of a curve: two for each of so many spans of time.
SHOWN = 1200
#: What the page calls numbers of a law.
_SIGNALS = {
    "kp": "Kp", "ki": "Ki", "kd": "Kd", "integral_order": "λ", "derivative_order": "μ", "s": "S",
    "u_law": "torque of the law itself [N m]", "u_model": "torque by the model [N m]",
    "u_s": "torque of the supervisor [N m]",
}  # fmt: skip
#: Units of the table below the curves.
_UNITS = ("rad", "rad s", "N m", "N²m²s")
_SCRIPTS = ("scene", *(f"playground{k}" for k in ("_settings", "_views", "_controls", "")))


@checked
def playground(
    experiment: Experiment,
    controllers: Controller | Sequence[Controller] | None = None,
    path: str | Path | None = None,
    *,
    title: str = "",
) -> Page:
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
        of one's own has a slider for each field that is a number. None: that of `suggest_gains`.
        Where an adaptive FPID is among them, and none with feedforward and observer, the page
        offers these, too: with the first one's gains and orders, and the same with orders 1.
    path
        The file; it appears whole or not at all. None: for a notebook, nothing is written.
    title
        Of the page; empty: the arm's name.

    Returns
    -------
    Page

    Raises
    ------
    ArgumentError, ArmError, DesignError
        What the page cannot hold: a law in plain Python, another integrator or disturbance,
        CRONE's poles, an arm with other joints than revolute and prismatic ones.
    """
    e = experiment
    if controllers is None:
        controllers = suggest_gains(e.arm, step=e.step, name="FPID")
    laws: list[Law] = []
    for controller in checks.several("controllers", controllers, Controller, "a Controller"):
        laws.append(Law(controller, e, laws))
    if not laws:
        raise ArgumentError("controllers", "at least one controller", "none")
    for controller in _with_model(e, laws):
        laws.append(Law(controller, e, laws))
    if e.integrator != "semi_implicit_euler":
        raise ArgumentError("integrator", "semi_implicit_euler in a page", e.integrator)
    steps = settings.steps_of(e, laws)
    kernels, table = engine(e, laws, steps)
    shown = table | settings.outside(e) | {"shown": SHOWN}
    names = _names(laws)
    title = title or f"{e.arm.name}, {names[0] if len(names) == 1 else f'{len(names)} controllers'}"
    tables = {
        "ENGINE": {key: shown[key] for key in ("duration", "shown", "disturbance")},
        "PAGE": _page(e, laws, names, steps) | {"title": title},
    }
    worker = [
        f"const E = {to_script_json(shown)};\nconst M = new Float64Array(E.words);\n"
        f"const K = (() => {{\n{kernels}}})();\n",
        *(asset(f"playground_{name}.js") for name in ("noise", "engine")),
    ]
    text = document(
        title,
        style=asset("uPlot.min.css") + asset("playground.css"),
        body=Template(asset("playground.html")).substitute(
            title=as_text(title),
            scene=to_script_json(experiment_scene(e, e.arm.name, e.duration)),
            engine=closed("".join(worker)),
            angle=unit_for("rad", e.arm.units),
            effort=unit_for("N m", e.arm.units),
        ),
        scripts=[
            meshcat_file("dist/main.min.js"),
            asset("uPlot.iife.min.js"),
            *(f"const {name} = {to_script_json(table)};" for name, table in tables.items()),
            *(asset(f"{name}.js") for name in _SCRIPTS),
        ],
        comment=licences([e.arm.credit] if e.arm.credit else [])
        + "\nThe plots are drawn by uPlot (github.com/leeoniya/uPlot):\n"
        + asset("uPlot.LICENSE.txt"),
    )
    written = None if path is None else put_text(path, text)
    return Page(text, "Playground", 820, written, "allow-scripts allow-downloads allow-modals")


# ------------------------------------------------------------------ laws


def _with_model(e: Experiment, laws: Sequence[Law]) -> list[Controller]:
    """Return the first adaptive FPID beside feedforward and observer, and that with orders 1.

    None where the page has such a law, or no FPID.
    """
    first = next((x.controller for x in laws if isinstance(x.controller, AdaptiveFpid)), None)
    if first is None or any(law.has_model for law in laws):
        return []
    with warnings.catch_warnings(action="ignore", category=FpidWarning):
        observer = first.bandwidth or suggest_observer(e.arm, first, step=e.step)
    name = "FPID + feedforward + observer"
    best = replace(first, feedforward=True, observer=observer, name=name)
    integer = replace(
        best, integral_order=1.0, derivative_order=1.0, order_learning_rate=0.0,
        name=name.replace("FPID", "integer PID"),
    )  # fmt: skip
    return [best, integer]


def _names(laws: Sequence[Law]) -> list[str]:
    """Return what the page calls the laws: by name, or by kind and number."""
    found: list[str] = []
    for law in laws:
        kind = "adaptive FPID" if law.is_fpid else type(law.controller).__name__
        name = law.controller.name or kind
        found.append(f"{name} {len(found) + 1}" if name in found else name)
    return found


def _page(
    e: Experiment, laws: Sequence[Law], names: Sequence[str], steps: list[float]
) -> dict[str, Any]:
    """Return what the page has to know beside its engine."""
    start = settings.start_of(e, laws)
    about = [
        {
            "name": name, "groups": settings.law_groups(law), "orders": law.orders,
            "bound": settings.rounded(law.supervisor.reference_bound * 1.0001),
            "signals": [[x, head_for(_SIGNALS.get(x, x), e.arm.units)] for x in law.signals],
        }
        for law, name in zip(laws, names, strict=True)
    ]  # fmt: skip
    return {
        "joints": list(e.arm.joint_names),
        "units": [{u: unit_for(u, [angle]) for u in _UNITS} for angle in e.arm.units],
        "start": start, "steps": steps, "laws": about, "groups": settings.shared_groups(e, start),
        "presets": settings.presets(e, laws, steps), "toml": settings.toml_of(e, laws, names),
        "palette": {"light": PALETTE, "dark": ON_DARK},
    }  # fmt: skip
