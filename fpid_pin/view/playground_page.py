"""A playground: one page, without a network, that simulates again as a slider moves."""

from __future__ import annotations

import csv
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.control import suggest_gains, suggest_observer
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.files import put_text
from fpid_pin.simulation.entry import simulate
from fpid_pin.simulation.experiment import PUBLISHED_ORDERS, TUNED_ORDERS, Experiment, of_paper
from fpid_pin.text import head_for, unit_for
from fpid_pin.view import playground_settings as settings
from fpid_pin.view.document import Page, as_text, asset, closed, document
from fpid_pin.view.playground_engine import Engine
from fpid_pin.view.playground_law import Law
from fpid_pin.view.replay import licences, meshcat_file
from fpid_pin.view.scene import experiment_scene, to_script_json
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
_SCRIPTS = (
    "bodies", "stage", "playground_settings", "playground_plots", "playground_scene",
    "playground_controls", "playground",
)  # fmt: skip


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
    text = playground_html(experiment, controllers, title=title)
    written = None if path is None else put_text(path, text)
    return Page(text, "Playground", 820, written, "allow-scripts allow-downloads allow-modals")


def playground_html(
    experiment: Experiment,
    controllers: Controller | Sequence[Controller] | None = None,
    *,
    title: str = "",
) -> str:
    """Return the text of the page that `playground` makes."""
    checks.instance("experiment", experiment, Experiment, "an Experiment")
    if controllers is None:
        controllers = suggest_gains(experiment.arm, step=experiment.step, name="FPID")
    laws: list[Law] = []
    for controller in checks.several("controllers", controllers, Controller, "a Controller"):
        laws.append(Law(controller, experiment, laws))
    if not laws:
        raise ArgumentError("controllers", "at least one controller", "none")
    for controller in _with_model(experiment, laws):
        laws.append(Law(controller, experiment, laws))
    if experiment.integrator != "semi_implicit_euler":
        raise ArgumentError("integrator", "semi_implicit_euler in a page", experiment.integrator)
    steps = settings.steps_of(experiment, laws)
    engine = Engine(experiment, laws, steps)
    shown = engine.table | settings.outside(experiment) | {"shown": SHOWN}
    names = _names(laws)
    what = names[0] if len(names) == 1 else f"{len(names)} controllers"
    title = title or f"{experiment.arm.name}, {what}"
    tables = {
        "SCENE": experiment_scene(experiment, experiment.arm.name, experiment.duration),
        "ENGINE": {key: shown[key] for key in ("duration", "shown", "disturbance")},
        "PAGE": _page(experiment, laws, names, steps) | {"title": title},
    }
    return document(
        title,
        style=asset("uPlot.min.css") + asset("playground.css"),
        body=Template(asset("playground.html")).substitute(
            title=as_text(title),
            engine=_worker(engine, shown),
            angle=unit_for("rad", experiment.arm.units),
            effort=unit_for("N m", experiment.arm.units),
        ),
        scripts=[
            meshcat_file("dist/main.min.js"),
            asset("uPlot.iife.min.js"),
            *(f"const {name} = {to_script_json(table)};" for name, table in tables.items()),
            *(asset(f"{name}.js") for name in _SCRIPTS),
        ],
        comment=licences([experiment.arm.credit] if experiment.arm.credit else [])
        + "\nThe plots are drawn by uPlot (github.com/leeoniya/uPlot):\n"
        + asset("uPlot.LICENSE.txt"),
    )


def _has_model(law: Law) -> bool:
    """Whether a law is an adaptive FPID beside feedforward and observer."""
    own = law.controller
    return isinstance(own, AdaptiveFpid) and own.feedforward and own.observer > 0.0


def _has_orders(law: Law) -> bool:
    own = law.controller
    orders = (own.integral_order, own.derivative_order) if isinstance(own, AdaptiveFpid) else ()
    return any(np.any(np.asarray(order) != 1.0) for order in orders)


def _with_model(e: Experiment, laws: Sequence[Law]) -> list[Controller]:
    """Return the first adaptive FPID beside feedforward and observer, and that with orders 1.

    None where the page has such a law, or no FPID.
    """
    first = next((x.controller for x in laws if isinstance(x.controller, AdaptiveFpid)), None)
    if first is None or any(map(_has_model, laws)):
        return []
    with warnings.catch_warnings(action="ignore", category=FpidWarning):
        observer = first.observer or suggest_observer(e.arm, first, step=e.step)
    name = "FPID + feedforward + observer"
    best = replace(first, feedforward=True, observer=observer, name=name)
    integer = replace(
        best, integral_order=1.0, derivative_order=1.0, order_learning_rate=0.0,
        name=name.replace("FPID", "integer PID"),
    )  # fmt: skip
    return [best, integer]


def _worker(engine: Engine, table: dict[str, Any]) -> str:
    parts = [
        f"const E = {to_script_json(table)};\nconst M = new Float64Array(E.words);\n"
        f"const K = (() => {{\n{engine.text}}})();\n",
        *(asset(f"playground_{name}.js") for name in ("noise", "engine", "worker")),
    ]
    return closed("".join(parts))


def _names(laws: Sequence[Law]) -> list[str]:
    """Return what the page calls the laws: by name, or by kind and number."""
    found: list[str] = []
    for law in laws:
        kind = "adaptive FPID" if isinstance(law.controller, AdaptiveFpid) else ""
        name = law.controller.name or kind or type(law.controller).__name__
        found.append(f"{name} {len(found) + 1}" if name in found else name)
    return found


def _page(
    e: Experiment, laws: Sequence[Law], names: Sequence[str], steps: list[float]
) -> dict[str, Any]:
    """Return what the page has to know beside its engine."""
    with warnings.catch_warnings(action="ignore", category=FpidWarning):
        # What the description has to say about limits it said when it was made.
        alone = replace(laws[0].controller, supervisor=None)
        run = simulate(replace(e, dynamics="compiled"), alone)
    peak = np.abs(run.torque).max(axis=0, initial=0.1)
    start = settings.start_settings(e, laws)
    about = [
        {
            "name": name,
            "fpid": isinstance(law.controller, AdaptiveFpid),
            "groups": settings.law_groups(law),
            "orders": law.orders,
            "bound": settings.rounded(law.supervisor.reference_bound * 1.0001),
            "signals": [
                [signal, head_for(_SIGNALS.get(signal, signal), e.arm.units)]
                for signal in law.signals
            ],
        }
        for law, name in zip(laws, names, strict=True)
    ]
    return {
        "joints": list(e.arm.joint_names),
        "units": [{u: unit_for(u, [angle]) for u in _UNITS} for angle in e.arm.units],
        "start": start, "steps": steps, "laws": about,
        "groups": settings.shared_groups(e, start),
        "presets": _presets(e, laws, steps, peak.tolist()),
        "toml": settings.toml_tables(e, laws, names),
        "palette": {"light": PALETTE, "dark": ON_DARK},
    }  # fmt: skip


def _presets(
    e: Experiment, laws: Sequence[Law], steps: Sequence[float], peak: Sequence[float]
) -> list[dict[str, Any]]:
    """Return the presets that a page can have, as `assets/playground_presets.csv` has them.

    `peak` is the largest torque of the described run, (n,) [N m], and sizes loads and limits.
    Settings of a law are those of the first adaptive FPID. The table's columns: what a page `needs`
    for it; the settings `now`, and those of the run that is `pinned` beside it, ``nothing`` or
    those that differ from the description. A value is a number, how much of one of `sizes`, or
    ``yes`` or ``no``; ``orders`` stands for both of a law's, ``law`` for one that is not the first:
    ``alone``, or beside feedforward and observer, ``best`` or, with orders 1, ``integer``.
    """
    fpids = [k for k, x in enumerate(laws) if isinstance(x.controller, AdaptiveFpid)]
    index, ours = fpids[0] if fpids else 0, of_paper(e.arm)
    kinds = {
        "alone": [k for k in fpids if not _has_model(laws[k])],
        "best": [k for k in fpids if _has_model(laws[k]) and _has_orders(laws[k])],
        "integer": [k for k in fpids if _has_model(laws[k]) and not _has_orders(laws[k])],
    }
    guard, own = laws[index].supervisor, {*laws[index].settings, "supervised", "m_x"}
    weight = float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max())
    each = np.ones(e.arm.n)
    sizes: dict[str, Any] = {
        "": 1.0, "each": each, "peak": np.asarray(peak), "weight": max(weight / 9.8, 2.0),
        "close": 1.3 * guard.reference_bound + 0.3, "longest": max(steps),
        "slow": 1.0 if e.arm.n == 2 else 0.1,
    }  # fmt: skip
    orders: dict[str, Any] = {
        "1": (each, each), "published": PUBLISHED_ORDERS["symbol"],
        "sign": PUBLISHED_ORDERS["sign"], "tuned": TUNED_ORDERS,
    }  # fmt: skip
    able = {
        "": True, "several": len(laws) > 1, "slower": max(steps) > e.step, "fpid": bool(fpids),
        "paper": bool(fpids) and ours, "printed": guard.kind == "paper",
        "sampled": guard.kind != "paper", "best": bool(kinds["best"] and kinds["alone"]),
        "both": bool(kinds["best"] and kinds["integer"]),
    }  # fmt: skip

    def chosen(text: str) -> dict[str, Any] | None:
        if text == "nothing":
            return None
        found: dict[str, Any] = {}
        controller = index
        for key, value in (part.split(" = ") for part in text.split("; ") if part):
            amount, _, size = value.partition(" ")
            if key == "orders":
                # The paper's orders, and those tuned for it, mean something on its arm alone.
                if ours or value == "1":
                    names = ("integral_order", "derivative_order")
                    found |= {k: list(x) for k, x in zip(names, orders[value], strict=True)}
            elif key == "law":
                controller = kinds[value][0]
            elif key == "beside":
                found[key] = [k for k in range(len(laws)) if k != index]
            elif amount in ("yes", "no"):
                found[key] = amount == "yes"
            else:
                total = float(amount) * sizes[size]
                parts = [settings.rounded(x, 2) for x in np.ravel(total)]
                found[key] = parts if np.ndim(total) else parts[0]
        named = {f"{index}.{key}" if key in own else key: x for key, x in found.items()}
        return {"controller": controller, **named}

    return [
        {"name": row["name"], "text": row["text"], "now": chosen(row["now"]),
         "pinned": chosen(row["pinned"])}
        for row in csv.DictReader(asset("playground_presets.csv").splitlines())
        if able[row["needs"]]
    ]  # fmt: skip
