"""What a playground's sliders start from, how far they go, and the TOML that they change.

A setting of a law has its number before its name, ``"0.kp"``; all laws share the others.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.descriptions import to_dict
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Sinusoid
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.view.playground_engine import MOST_DELAY, encoded
from fpid_pin.view.playground_law import Law, supervisor_of

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
    plant, sensors, n = plant_of(e), e.sensors, e.arm.n
    main, _, _ = _disturbance(e)

    def noise(name: str) -> float:
        value = np.asarray(0.0 if sensors is None else getattr(sensors, name))
        if np.ptp(value) > 0.0:
            raise ArgumentError(f"sensors.{name}", "one number for a page's slider", value.tolist())
        return float(value.max())

    settings: dict[str, Any] = {"controller": 0, "beside": []}
    for k, law in enumerate(laws):
        guard = {
            "supervised": law.controller.supervisor is not None,
            "m_x": supervisor_of(e, law.controller).m_x,
        }
        settings |= {f"{k}.{key}": value for key, value in (law.settings | guard).items()}
    return _sayable(settings | {
        "payload": 0.0,
        "viscous_friction": plant.viscous_friction.tolist(),
        "dry_friction": plant.dry_friction.tolist(),
        "effort_limit": plant.effort_limit.tolist(),
        "knows_limit": bool(np.array_equal(plant.effort_limit, e.arm.effort_limit)),
        "disturbance": (np.zeros(n) + np.asarray(main.amplitude)).tolist(),
        "disturbance_frequency": float(np.max(main.frequency)),
        "reference_size": 1.0,
        "reference_speed": 1.0,
        "position_noise": noise("position_noise"),
        "velocity_noise": noise("velocity_noise"),
        "position_resolution": noise("position_resolution"),
        "differentiated": sensors is not None and sensors.velocity == "differentiated",
        "delay": 0 if sensors is None else sensors.delay,
        "q0": np.asarray(e.q0).tolist(),
        "step": e.step,
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
    table: dict[str, Any] = {
        "reference": reference,
        "disturbance": {"phase": np.asarray(main.phase).tolist(), "others": others},
        "v0": np.asarray(e.v0).tolist(),
        "duration": e.duration,
        "runaway": e.runaway_speed,
        "joints": list(e.arm.joint_names),
        "cutoff": 500.0 if e.sensors is None else e.sensors.velocity_cutoff,
    }
    return _sayable(table)


def toml_tables(e: Experiment, laws: Sequence[Law], names: Sequence[str]) -> dict[str, Any]:
    """Return the configuration that the page's settings change, as plain tables."""
    whole = to_dict(e)
    _, movable, others = _disturbance(e)
    controllers = []
    for law, name in zip(laws, names, strict=True):
        supervisor = to_dict(supervisor_of(e, law.controller))
        own = {"supervisor": supervisor, "scale": law.controller.scale_on(e.arm).tolist()}
        controllers.append(to_dict(law.controller) | own | {"name": name})
    kept = ("q0", "v0", "step", "duration", "integrator", "seed", "runaway_speed")
    plant = {key: x for key, x in whole.get("plant", {}).items() if key != "disturbance"}
    sensors = {key: x for key, x in whole.get("sensors", {}).items() if key != "kind"}
    return _sayable({
        "arm": whole["arm"], "reference": whole["reference"],
        "simulation": {key: whole[key] for key in kept} | {"dynamics": "compiled"},
        "plant": {key: x for key, x in plant.items() if key != "kind"}, "sensors": sensors,
        "others": others, "movable": movable, "controllers": controllers,
    })  # fmt: skip


def _sayable(table: dict[str, Any]) -> dict[str, Any]:
    """Return plain tables in which infinities are the numbers that the page takes for them."""
    return {key: _said(value) for key, value in table.items()}


def _said(value: Any) -> Any:
    if isinstance(value, dict):
        return _sayable(value)
    if isinstance(value, (list, tuple)):
        return [_said(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return math.copysign(NONE, value)
    return value


def tidy(x: float) -> float:
    """Return a number of three digits."""
    return float(f"{x:.3g}")


def control(
    key: str, label: str, low: float, high: float, unit: str = "", scale: str = "linear",
    joints: str = "same", note: str = "", least: float = 0.0, step: float = 0.0,
) -> dict[str, Any]:  # fmt: skip
    """Return a slider: its setting, words, bounds, and how it moves.

    Parameters
    ----------
    scale
        ``"linear"``, in steps of `step`; ``"log"`` (from `low`); ``"log0"``: 0 at the left end,
        then from `least`; ``"limit"``: log, and none at the right end; ``"gain"``: a tenth to ten
        times the described value; ``"stops"``: the steps on offer; ``"switch"``.
    joints
        What the slider above those of the joints does: ``"same"`` sets all alike, ``"factor"``
        multiplies what each has.
    """
    return {
        "key": key, "label": label, "low": low, "high": high, "unit": unit, "scale": scale,
        "joints": joints, "note": note, "least": least, "step": step,
    }  # fmt: skip


def law_groups(e: Experiment, law: Law) -> list[dict[str, Any]]:
    """Return the sliders of a law, grouped; an own law has one for each of its fields."""
    bound = supervisor_of(e, law.controller).reference_bound
    watch = [
        control("supervised", "supervisor", 0, 1, "", "switch",
                note="keeps the error inside a set, with the nominal model's help"),
        control("m_x", "Mₓ", tidy(bound + 0.05), tidy(4.0 * bound + 5.0), "", "log",
                note="radius that no joint's [q, q′] may leave"),
    ]  # fmt: skip
    if not isinstance(law.controller, AdaptiveFpid):
        orders = {x.order for x in law.state.controller.operators.values()}
        fields = []
        for key, value in law.settings.items():
            label = key.replace("_", " ")
            if key in orders:
                fields.append(control(key, label, 0, 1, step=0.001, note="order of an operator"))
            elif np.min(value) > 0.0:
                fields.append(control(key, label, 0, 0, "", "gain", "factor"))
            else:
                fields.append(control(key, label, 0, 100, "", "log0", least=1e-3))
        own = [{"name": "Parameters", "controls": fields}] if fields else []
        return [*own, {"name": "Supervisor", "controls": watch}]

    def most(key: str) -> float:
        return max([10.0, *(4.0 * float(x) for x in law.settings[key])])

    orders_ = [
        control("integral_order", "λ", 0, 1, step=0.001, note="order of the integral"),
        control("derivative_order", "μ", 0, 1, step=0.001, note="order of the derivative"),
        control("order_learning_rate", "γₒ", 0, 1, "", "log0", least=1e-5,
                note="learning rate of the orders"),
    ]  # fmt: skip
    gains = [
        control(f"k{letter}", f"K{letter}", 0, 0, "", "gain", "factor", f"{word} gain at the start")
        for letter, word in (("p", "proportional"), ("i", "integral"), ("d", "derivative"))
    ]
    learning = [
        control("learning_rate", "γ", 0, 100, "× described", "log0", least=0.01,
                note="learning rate of the gains"),
        control("k0", "k₀", 0, most("k0"), "1/s²", step=0.05, note="sliding surface, weight of ∫e"),
        control("k1", "k₁", 0, most("k1"), "1/s", step=0.05, note="sliding surface, weight of e"),
        control("sigma", "σ", 0, 10, "1/s", "log0", least=1e-3,
                note="leakage of the gains to where they began"),
        control("dead_zone", "|S|₀", 0, 1, "", "log0", least=1e-4,
                note="no learning while |S| is below"),
    ]  # fmt: skip
    names = ("Orders", "Gains at the start", "Learning", "Supervisor")
    parts = (orders_, gains, learning, watch)
    return [{"name": name, "controls": x} for name, x in zip(names, parts, strict=True)]


def shared_groups(e: Experiment, start: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the sliders that all laws share, grouped; bounds come from the description."""

    def most(key: str, floor: float) -> float:
        return max([floor, *(4.0 * float(x) for x in start[key] if x < NONE)])

    # Torques of the size that the arm needs.
    torque = max(float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max()), 1.0)
    top = most("effort_limit", 0.0) or 40.0 * torque
    limited = min(start["effort_limit"]) < NONE
    robot = [
        control("payload", "payload", 0, max(round(2.0 * torque / 9.8), 2), "kg", step=0.05,
                note="held by the tool; the law does not know"),
        control("viscous_friction", "viscous friction", 0, most("viscous_friction", 50.0),
                "N m s/rad", "log0", least=1e-2),
        control("dry_friction", "dry friction", 0, most("dry_friction", torque), "N m", "log0",
                least=1e-2),
        control("effort_limit", "effort limit", 0.02 * top, top, "N m", "limit",
                "factor" if limited else "same", "where the drives clip"),
        control("knows_limit", "the law knows its limit", 0, 1, "", "switch",
                note="off: its integrals wind up"),
    ]  # fmt: skip
    outside_ = [
        control("disturbance", "disturbance", 0, most("disturbance", 2.0 * torque), "N m", "log0",
                least=0.01, note="amplitude"),
        control("disturbance_frequency", "its frequency", 0.1, 200, "rad/s", "log"),
    ]  # fmt: skip
    if isinstance(e.reference, Sinusoid):
        outside_ += [
            control("reference_size", "motion, size", 0, 2, "× described", step=0.01),
            control("reference_speed", "motion, speed", 0.1, 5, "× described", "log"),
        ]
    sensors = [
        control("velocity_noise", "rate noise", 0, 1, "rad/s", "log0", least=1e-4,
                note="standard deviation"),
        control("position_noise", "angle noise", 0, 0.1, "rad", "log0", least=1e-6,
                note="standard deviation"),
        control("position_resolution", "encoder step", 0, 0.1, "rad", "log0", least=1e-6),
        control("differentiated", "rates from the encoder", 0, 1, "", "switch",
                note="a filtered difference of the angle"),
        control("delay", "delay", 0, min(MOST_DELAY, 60), "samples", step=1),
        control("step", "step", 0, 0, "s", "stops", note="sampling and integration"),
    ]  # fmt: skip
    names = ("Robot", "Motion and disturbance", "Sensors and clock")
    parts = (robot, outside_, sensors)
    return [{"name": name, "controls": x} for name, x in zip(names, parts, strict=True)]
