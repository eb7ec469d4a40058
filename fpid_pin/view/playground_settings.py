"""What a playground's sliders start from, how far they go, and the TOML that they change.

A setting of a law has its number before its name, ``"0.kp"``; all laws share the others.
"""

import csv
import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin.descriptions import to_dict
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.exceptions import ArgumentError, FpidWarning
from fpid_pin.references import Sinusoid
from fpid_pin.simulation.entry import simulate
from fpid_pin.simulation.experiment import (
    PUBLISHED_ORDERS,
    TUNED_ORDERS,
    Experiment,
    of_paper,
)
from fpid_pin.simulation.toml import own_files
from fpid_pin.text import unit_for
from fpid_pin.view.document import asset
from fpid_pin.view.playground_engine import Law, encoded, one_number

#: Steps that a page offers [s], where a run of them has no more rows than this.
STEPS, MOST_ROWS = (2.5e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2), 100_001
#: Infinity in JSON: a number beyond all others.
NONE = 1e300


def steps_of(e: Experiment, laws: Sequence[Law]) -> list[float]:
    """Return the steps that a page offers, the description's own among them."""
    some = {e.step, *(h for h in STEPS if e.duration / h < MOST_ROWS and e.duration > 4 * h)}
    formula = isinstance(e.reference, Sinusoid)
    return sorted(some) if formula and all(x.follows_steps(some) for x in laws) else [e.step]


def _disturbance(e: Experiment) -> tuple[Cosine, bool, list[dict[str, Any]]]:
    """Return the cosine that the sliders move, whether it is described, and the other parts."""
    d = e.resolved.disturbance
    parts: Sequence[Any] = () if d is None else d.parts if isinstance(d, Sum) else (d,)
    for part in parts:
        if not isinstance(part, (Cosine, Pulse)):
            raise ArgumentError("disturbance", "cosines and pulses in a page", type(part).__name__)
    movable = [p for p in parts if isinstance(p, Cosine) and np.ptp(p.frequency) == 0.0]
    main = movable[0] if movable else Cosine(0.0)
    return main, bool(movable), [to_dict(p) for p in parts if p is not main]


def outside(e: Experiment) -> Any:
    """Return what acts on a run from outside, as the engine's table has it."""
    main, _, others = _disturbance(e)
    if isinstance(e.reference, Sinusoid):
        reference = to_dict(e.reference)
    else:
        rows = e.motion(np.arange(e.rows, dtype=np.float64) * e.step)
        reference = {"kind": "rows", "rows": encoded(np.concatenate([x.ravel() for x in rows]))}
    return _plain({
        "reference": reference,
        "disturbance": {"phase": main.phase, "others": others},
        "v0": np.asarray(e.v0), "duration": e.duration, "runaway": e.runaway_speed,
        "joints": list(e.arm.joint_names), "units": list(e.arm.units),
        "targets": [
            [x["key"], *x["memory"].rsplit(".", 1)] for x in _table("sliders") if x["memory"]
        ],
        "cutoff": 500.0 if e.sensors is None else e.sensors.velocity_cutoff,
    })  # fmt: skip


def start_of(e: Experiment, laws: Sequence[Law]) -> Any:
    """Return the settings that stand for a description."""
    plant, main = e.resolved, _disturbance(e)[0]
    sensors = {} if e.sensors is None else to_dict(e.sensors)
    noise = {
        name: one_number(f"sensors.{name}", sensors.get(name, 0.0))
        for name in ("position_noise", "velocity_noise", "position_resolution")
    }
    own: dict[str, Any] = {}
    for k, law in enumerate(laws):
        guarded = {"supervised": law.controller.supervisor is not None, "m_x": law.supervisor.m_x}
        own |= {f"{k}.{key}": value for key, value in (law.settings | guarded).items()}
    return _plain({
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


def toml_of(e: Experiment, laws: Sequence[Law], names: Sequence[str]) -> Any:
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
    return _plain({
        "arm": whole["arm"], "reference": whole["reference"], "disturbance": others,
        "plant": without("plant", "disturbance", "kind"), "sensors": without("sensors", "kind"),
        "simulation": {key: whole[key] for key in kept} | {"dynamics": "compiled"},
        "movable": movable, "controllers": controllers,
        "import": [Path(file).name for file in own_files([law.controller for law in laws])],
    })  # fmt: skip


def _plain(value: Any) -> Any:
    """Return plain values, in which infinities are the numbers that the page takes for them."""
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    return math.copysign(NONE, value) if value in (math.inf, -math.inf) else value


# ------------------------------------------------------------------ sliders and presets


def _table(name: str) -> list[dict[str, str]]:
    return list(csv.DictReader(asset(f"playground_{name}.csv").splitlines()))


def rounded(x: float) -> float:
    """Return a number of three digits."""
    return float(f"{x:.3g}")


def _sliders(
    of: Sequence[str], described: Mapping[str, Any], sizes: Mapping[str, float]
) -> list[dict[str, Any]]:
    """Return the groups of sliders of these kinds, as `assets/playground_sliders.csv` has them.

    Its columns: setting, words, bounds, where it goes (`memory`: array and field of each joint;
    `toml`: its path in the configuration, and ``times`` or ``more`` where it is a factor of what
    stands there or comes on top), and how a slider moves (`scale`): ``linear``, in steps of `step`;
    ``log`` (from `low`); ``log0``: 0 at the left end, then from `least`; ``limit``: log, and none
    at the right end; ``gain``: a tenth to ten times the described value; ``stops``: the steps on
    offer; ``switch``. The slider above those of the joints sets all alike (``same``) or multiplies
    what each has (``factor``). A bound is a number or one of `sizes`, ``most`` of it and four times
    the described value.
    """

    def bound(text: str, key: str) -> float:
        word, _, floor = text.rpartition(" ")
        least = sizes[floor] if floor in sizes else float(floor)
        values = np.ravel(described[key]) if word else ()
        return max([least, *(4.0 * float(x) for x in values if x < NONE)])

    groups: dict[str, list[dict[str, Any]]] = {}
    for row in _table("sliders"):
        if row.pop("of") in of:
            numbers = {name: bound(row[name], row["key"]) for name in ("low", "high")}
            numbers |= {name: float(row[name]) for name in ("least", "step")}
            groups.setdefault(row.pop("group"), []).append(row | numbers)
    return [{"name": name, "controls": controls} for name, controls in groups.items()]


def law_groups(law: Law) -> list[dict[str, Any]]:
    """Return the sliders of a law, grouped; an own law has one for each of its fields."""
    bound = law.supervisor.reference_bound
    sizes = {"radius": rounded(bound + 0.05), "widest": rounded(4.0 * bound + 5.0)}
    if law.is_fpid:
        return _sliders(("fpid", "any"), law.settings, sizes)
    fields = []
    for key, value in law.settings.items():
        slider: dict[str, Any] = {
            "key": key, "label": key.replace("_", " "), "low": 0, "high": 100, "unit": "",
            "scale": "log0", "joints": "same", "least": 1e-3, "step": 0, "note": "",
            "toml": f"law.{key}",
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
        if slider["key"] == "effort_limit" and limits:
            slider["joints"] = "factor"
    return groups


class _Size:
    """A size, one number or one of each joint, of which a text takes some: ``{peak:0.6}``."""

    def __init__(self, size: Any) -> None:
        self._size = np.ravel(size)

    def __format__(self, factor: str) -> str:
        return ",".join(f"{x:.2g}" for x in float(factor) * self._size)


def presets(e: Experiment, laws: Sequence[Law], steps: Sequence[float]) -> list[dict[str, Any]]:
    """Return the presets that a page can have, as `assets/playground_presets.csv` has them.

    The table's columns: what a page `needs` for it; the link of the settings `now`, and that of
    the run that is `pinned` beside it, or ``nothing``. Settings of a law are those of the first
    adaptive FPID unless a link says ``controller``. In braces is how much of a size, the orders of
    the paper (which mean nothing on another arm) or ones, or a law's number: an FPID ``alone``, or
    beside feedforward and observer, ``best`` or, with orders 1, ``integer``.
    """
    with warnings.catch_warnings(action="ignore", category=FpidWarning):
        # What the description has to say about limits it said when it was made.
        alone = replace(laws[0].controller, supervisor=None)
        run = simulate(replace(e, dynamics="compiled"), alone)
    # Loads and limits are sized by the described run's largest torques.
    peak = np.abs(run.torque).max(axis=0, initial=0.1)
    fpids = [k for k, x in enumerate(laws) if x.is_fpid]
    first, ours, each = fpids[0] if fpids else 0, of_paper(e.arm), np.ones(e.arm.n)
    modelled = [k for k in fpids if laws[k].has_model]
    orders_of = {k: [np.asarray(laws[k].settings[x]) for x in laws[k].orders] for k in modelled}
    fractional = [k for k in modelled if any((order != 1.0).any() for order in orders_of[k])]
    kinds = {
        "alone": [k for k in fpids if k not in modelled],
        "best": fractional,
        "integer": [k for k in modelled if k not in fractional],
    }
    guard = laws[first].supervisor
    weight = float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max()) / 9.8
    orders: dict[str, Sequence[Any]] = {
        "published": PUBLISHED_ORDERS["symbol"], "sign": PUBLISHED_ORDERS["sign"],
        "tuned": TUNED_ORDERS, "ones": (each, each),
    }  # fmt: skip
    words: dict[str, Any] = {
        "each": _Size(each), "peak": _Size(peak), "weight": _Size(max(weight, 2.0)),
        "close": _Size(1.3 * guard.reference_bound + 0.3), "longest": _Size(max(steps)),
        "slow": _Size(1.0 if e.arm.n == 2 else 0.1),
        "others": ",".join(str(k) for k in range(len(laws)) if k != first),
        **{kind: found[0] for kind, found in kinds.items() if found},
    }  # fmt: skip
    for kind, values in orders.items():
        pairs = zip(("integral_order", "derivative_order"), values, strict=True)
        link = "&".join(f"{name}={','.join(map(str, x))}" for name, x in pairs)
        words[kind] = link if ours or kind == "ones" else ""
    able = {
        "": True, "several": len(laws) > 1, "slower": max(steps) > e.step, "fpid": bool(fpids),
        "paper": bool(fpids) and ours, "printed": guard.kind == "paper",
        "sampled": guard.kind != "paper", "best": bool(kinds["best"] and kinds["alone"]),
        "both": bool(kinds["best"] and kinds["integer"]),
    }  # fmt: skip

    def filled(text: str) -> str | None:
        if text == "nothing":
            return None
        found = text.format_map(words)
        return found if "controller=" in found else f"controller={first}&{found}"

    return [
        {**row, "now": filled(row["now"]), "pinned": filled(row["pinned"])}
        for row in _table("presets")
        if able[row["needs"]]
    ]
