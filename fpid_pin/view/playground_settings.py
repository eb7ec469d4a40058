"""What a playground's sliders start from, how far they go, and the TOML that they change.

A setting of a law has its number before its name, ``"0.kp"``; all laws share the others.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.descriptions import to_dict
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Sinusoid
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.simulation.toml import own_files
from fpid_pin.text import unit_for
from fpid_pin.view.document import asset
from fpid_pin.view.playground_engine import encoded
from fpid_pin.view.playground_law import Law, one_number

#: Steps that a page offers [s].
STEPS = (2.5e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
#: Rows beyond which a step is not offered: a run would take too long.
MOST_ROWS = 100_001
#: Infinity in JSON: a number beyond all others.
NONE = 1e300


def steps_of(experiment: Experiment, laws: Sequence[Law]) -> list[float]:
    """Return the steps that a page offers, the description's own among them."""
    own, duration = experiment.step, experiment.duration
    some = {own, *(h for h in STEPS if duration / h < MOST_ROWS and duration > 4 * h)}
    formula = isinstance(experiment.reference, Sinusoid)
    return sorted(some) if formula and all(x.follows_steps(sorted(some)) for x in laws) else [own]


def start_settings(e: Experiment, laws: Sequence[Law]) -> dict[str, Any]:
    """Return the settings that stand for a description."""
    plant, main = plant_of(e), _disturbance(e)[0]
    sensors = {} if e.sensors is None else to_dict(e.sensors)
    noise = {
        name: one_number(f"sensors.{name}", sensors.get(name, 0.0))
        for name in ("position_noise", "velocity_noise", "position_resolution")
    }
    own: dict[str, Any] = {}
    for k, law in enumerate(laws):
        guarded = {"supervised": law.controller.supervisor is not None, "m_x": law.supervisor.m_x}
        own |= {f"{k}.{key}": value for key, value in (law.settings | guarded).items()}
    return _plain_table({
        "controller": 0, "beside": [], **own, **noise, "payload": 0.0,
        "viscous_friction": plant.viscous_friction, "dry_friction": plant.dry_friction,
        "effort_limit": plant.effort_limit,
        "knows_limit": bool(np.array_equal(plant.effort_limit, e.arm.effort_limit)),
        "disturbance": np.zeros(e.arm.n) + np.asarray(main.amplitude),
        "disturbance_frequency": float(np.max(main.frequency)),
        "reference_size": 1.0, "reference_speed": 1.0,
        "differentiated": sensors.get("velocity") == "differentiated",
        "delay": sensors.get("delay", 0),
        "q0": np.asarray(e.q0), "step": e.step,
    })  # fmt: skip


def _disturbance(e: Experiment) -> tuple[Cosine, bool, list[dict[str, Any]]]:
    """Return the cosine that the sliders move, whether it is described, and the other parts."""
    d = plant_of(e).disturbance
    parts: Sequence[Any] = () if d is None else d.parts if isinstance(d, Sum) else (d,)
    for part in parts:
        if not isinstance(part, (Cosine, Pulse)):
            raise ArgumentError("disturbance", "cosines and pulses in a page", type(part).__name__)
    movable = [p for p in parts if isinstance(p, Cosine) and np.ptp(p.frequency) == 0.0]
    main = movable[0] if movable else Cosine(0.0)
    return main, bool(movable), [to_dict(p) for p in parts if p is not main]


def outside(e: Experiment) -> dict[str, Any]:
    """Return what acts on a run from outside, as the engine's table has it."""
    main, _, others = _disturbance(e)
    if isinstance(e.reference, Sinusoid):
        reference = to_dict(e.reference)
    else:
        rows = e.motion(np.arange(e.rows, dtype=np.float64) * e.step)
        reference = {"kind": "rows", "rows": encoded(np.concatenate([x.ravel() for x in rows]))}
    return _plain_table({
        "reference": reference,
        "disturbance": {"phase": main.phase, "others": others},
        "v0": np.asarray(e.v0), "duration": e.duration, "runaway": e.runaway_speed,
        "joints": list(e.arm.joint_names), "units": list(e.arm.units),
        "targets": [[x["key"], *x["memory"].rsplit(".", 1)] for x in _rows() if x["memory"]],
        "cutoff": 500.0 if e.sensors is None else e.sensors.velocity_cutoff,
    })  # fmt: skip


def toml_tables(e: Experiment, laws: Sequence[Law], names: Sequence[str]) -> dict[str, Any]:
    """Return the configuration that the page's settings change, as plain tables."""
    whole = to_dict(e)
    _, movable, others = _disturbance(e)
    controllers = [
        to_dict(law.controller) | {
            "supervisor": to_dict(law.supervisor),
            "scale": law.controller.scale_on(e.arm), "name": name,
        }
        for law, name in zip(laws, names, strict=True)
    ]  # fmt: skip

    def without(table: str, *keys: str) -> dict[str, Any]:
        return {key: x for key, x in whole.get(table, {}).items() if key not in keys}

    kept = ("q0", "v0", "step", "duration", "integrator", "seed", "runaway_speed")
    return _plain_table({
        "arm": whole["arm"], "reference": whole["reference"],
        "simulation": {key: whole[key] for key in kept} | {"dynamics": "compiled"},
        "plant": without("plant", "disturbance", "kind"), "sensors": without("sensors", "kind"),
        "others": others, "movable": movable, "controllers": controllers,
        "import": [Path(file).name for file in own_files([law.controller for law in laws])],
    })  # fmt: skip


def _plain_table(table: dict[str, Any]) -> dict[str, Any]:
    """Return plain values, in which infinities are the numbers that the page takes for them."""
    return {key: _plain(value) for key, value in table.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return _plain_table(value)
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return math.copysign(NONE, value) if value in (math.inf, -math.inf) else value


def _rows() -> Iterator[dict[str, str]]:
    return csv.DictReader(asset("playground_sliders.csv").splitlines())


def rounded(x: float, digits: int = 3) -> float:
    """Return a number of so many digits."""
    return float(f"{x:.{digits}g}")


def _sliders(
    of: Sequence[str], described: Mapping[str, Any], sizes: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the groups of sliders of these kinds, as `assets/playground_sliders.csv` has them.

    Its columns: setting, words, bounds, where it goes (`memory`: array and field of each joint;
    `toml`: a table of the configuration, which has it by this name), and how a slider moves
    (`scale`): ``linear``, in steps of `step`; ``log`` (from `low`); ``log0``: 0 at the left end,
    then from `least`; ``limit``: log, and none at the right end; ``gain``: a tenth to ten times the
    described value; ``stops``: the steps on offer; ``switch``. The slider above those of the joints
    sets all alike (``same``) or multiplies what each has (``factor``). A bound is a number or one
    of `sizes`, ``most`` of it and four times the described value.
    """

    def bound(text: str, key: str) -> float:
        word, _, floor = text.rpartition(" ")
        least = sizes[floor] if floor in sizes else float(floor)
        values = np.ravel(described[key]) if word else ()
        return max([least, *(4.0 * float(x) for x in values if x < NONE)])

    groups: dict[str, list[dict[str, Any]]] = {}
    for row in _rows():
        if row.pop("of") in of:
            numbers = {name: bound(row[name], row["key"]) for name in ("low", "high")}
            numbers |= {name: float(row[name]) for name in ("least", "step")}
            groups.setdefault(row.pop("group"), []).append(row | numbers)
    return [{"name": name, "controls": controls} for name, controls in groups.items()]


def law_groups(law: Law) -> list[dict[str, Any]]:
    """Return the sliders of a law, grouped; an own law has one for each of its fields."""
    bound = law.supervisor.reference_bound
    sizes = {"radius": rounded(bound + 0.05), "widest": rounded(4.0 * bound + 5.0)}
    if isinstance(law.controller, AdaptiveFpid):
        return _sliders(("fpid", "any"), law.settings, sizes)
    fields = []
    for key, value in law.settings.items():
        slider: dict[str, Any] = {
            "key": key, "label": key.replace("_", " "), "low": 0, "high": 100, "unit": "",
            "scale": "log0", "joints": "same", "least": 1e-3, "step": 0, "note": "", "toml": "law",
        }  # fmt: skip
        if key in law.orders:
            slider |= {"high": 1, "scale": "linear", "step": 0.001, "note": "order of an operator"}
        elif np.min(value) > 0.0:
            slider |= {"scale": "gain", "joints": "factor"}
        fields.append(slider)
    own = [{"name": "Parameters", "controls": fields}] if fields else []
    return [*own, *_sliders(("any",), law.settings, sizes)]


def shared_groups(e: Experiment, start: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Return the sliders that all laws share, grouped; bounds come from the description."""
    # Torques of the size that the arm needs.
    torque = max(float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max()), 1.0)
    limits = [x for x in start["effort_limit"] if x < NONE]
    top = 4.0 * max(limits) if limits else 40.0 * torque
    sizes = {
        "torque": torque, "push": 2.0 * torque, "mass": max(round(2.0 * torque / 9.8), 2),
        "slack": 0.02 * top, "top": top,
    }  # fmt: skip
    kinds = ("all", "sinusoid") if isinstance(e.reference, Sinusoid) else ("all",)
    groups = _sliders(kinds, start, sizes)
    for slider in (slider for group in groups for slider in group["controls"]):
        if not slider["key"].endswith("frequency"):
            slider["unit"] = unit_for(slider["unit"], e.arm.units)
    for slider in groups[0]["controls"]:
        if slider["key"] == "effort_limit" and limits:
            slider["joints"] = "factor"
    return groups
