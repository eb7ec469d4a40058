"""What a playground's sliders start from, how far they go, and the TOML that they change."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.control.safeguards import Safeguards
from fpid_pin.descriptions import to_dict
from fpid_pin.disturbances import Cosine, Pulse, Sum
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Sinusoid
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.view.playground_engine import MOST_DELAY, encoded, supervisor_of

#: Steps that a page offers [s].
STEPS = (2.5e-4, 5e-4, 1e-3, 2e-3, 5e-3, 1e-2, 2e-2, 5e-2)
#: Rows beyond which a step is not offered: a run would take too long.
MOST_ROWS = 100_001


def steps_of(experiment: Experiment) -> list[float]:
    """Return the steps that a page offers, the description's own among them."""
    own = experiment.step
    if not isinstance(experiment.reference, Sinusoid):
        return [own]
    some = {h for h in STEPS if experiment.duration / h < MOST_ROWS and experiment.duration > 4 * h}
    return sorted(some | {own})


def start_settings(experiment: Experiment, controller: AdaptiveFpid, index: int) -> dict[str, Any]:
    """Return the settings that stand for a description."""
    e, n, plant = experiment, experiment.arm.n, plant_of(experiment)
    sensors = e.sensors

    def each(name: str, value: Any) -> list[float]:
        return [float(x) for x in checks.spread(name, value, n)]

    rates = np.asarray(controller.order_learning_rate)
    if rates.size and np.ptp(rates) > 0.0:
        raise ArgumentError("order_learning_rate", "one number for a page's slider", rates.tolist())
    main, _, _ = _disturbance(e)
    guard = controller.safeguards

    def noise(name: str) -> float:
        value = np.asarray(0.0 if sensors is None else getattr(sensors, name))
        if np.ptp(value) > 0.0:
            raise ArgumentError(f"sensors.{name}", "one number for a page's slider", value.tolist())
        return float(value.max())

    # Gains count from the start as projected.
    low, high = Safeguards.bounds_of(guard, n)
    gains = {
        name: np.clip(each(name, getattr(controller, name)), lo, hi).tolist()
        for name, lo, hi in zip(("kp", "ki", "kd"), low, high, strict=True)
    }
    return {
        "controller": index,
        "integral_order": each("integral_order", controller.integral_order),
        "derivative_order": each("derivative_order", controller.derivative_order),
        **gains,
        "learning_rate": 1.0,
        "order_learning_rate": float(rates.max()),
        "k0": each("k0", controller.k0),
        "k1": each("k1", controller.k1),
        "sigma": 0.0 if guard is None else guard.sigma,
        "dead_zone": 0.0 if guard is None else guard.dead_zone,
        "supervised": controller.supervisor is not None,
        "m_x": supervisor_of(e, controller).m_x,
        "payload": 0.0,
        "viscous_friction": plant.viscous_friction.tolist(),
        "dry_friction": plant.dry_friction.tolist(),
        "effort_limit": [_finite(x) for x in plant.effort_limit],
        "knows_limit": bool(np.array_equal(plant.effort_limit, e.arm.effort_limit)),
        "disturbance": each("amplitude", main.amplitude),
        "disturbance_frequency": float(np.max(main.frequency)),
        "reference_size": 1.0,
        "reference_speed": 1.0,
        "position_noise": noise("position_noise"),
        "velocity_noise": noise("velocity_noise"),
        "position_resolution": noise("position_resolution"),
        "differentiated": sensors is not None and sensors.velocity == "differentiated",
        "delay": 0 if sensors is None else sensors.delay,
        "q0": [float(x) for x in np.asarray(e.q0)],
        "step": e.step,
    }


def _finite(x: float) -> float:
    """Return a limit as JSON can say it: none is a number beyond all others."""
    return float(x) if math.isfinite(x) else 1e300


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
    for other in others:
        if other.get("end") == math.inf:
            other["end"] = 1e300
    if isinstance(e.reference, Sinusoid):
        reference = to_dict(e.reference)
    else:
        t: FloatArray = np.arange(e.rows, dtype=np.float64) * e.step
        rows = e.motion(t)
        reference = {"kind": "rows", "rows": encoded(np.concatenate([x.ravel() for x in rows]))}
    phase = np.asarray(main.phase).tolist()
    return {
        "reference": reference,
        "disturbance": {"phase": phase, "others": others},
        "v0": np.asarray(e.v0).tolist(),
        "duration": e.duration,
        "runaway": e.runaway_speed,
        "joints": list(e.arm.joint_names),
        "cutoff": 500.0 if e.sensors is None else e.sensors.velocity_cutoff,
    }


def toml_tables(e: Experiment, controllers: Sequence[AdaptiveFpid]) -> dict[str, Any]:
    """Return the configuration that the page's settings change, as plain tables."""
    whole = to_dict(e)
    plant = whole.get("plant", {})
    _, movable, others = _disturbance(e)
    laws = []
    for controller in controllers:
        law = to_dict(controller)
        law["supervisor"] = to_dict(supervisor_of(e, controller))
        law["scale"] = controller.scale_on(e.arm).tolist()
        law["name"] = controller.name or "adaptive FPID"
        laws.append(law)
    kept = ("duration", "integrator", "seed", "runaway_speed", "v0")
    tables: dict[str, Any] = {
        "arm": whole["arm"],
        "reference": whole["reference"],
        "simulation": {key: whole[key] for key in kept} | {"dynamics": "compiled"},
        "plant": {key: plant[key] for key in ("arm",) if key in plant},
        "sensors": whole.get("sensors", {}),
        "others": others,
        "controllers": laws,
        "movable": movable,
    }
    sayable: dict[str, Any] = _sayable(tables)
    return sayable


def _sayable(value: Any) -> Any:
    """Return plain values in which infinities are the numbers that the page takes for them."""
    if isinstance(value, dict):
        return {key: _sayable(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_sayable(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return math.copysign(1e300, value)
    return value


def tidy(x: float) -> float:
    """Return a number of three digits."""
    return float(f"{x:.3g}")


def control(
    key: str, label: str, low: float, high: float, *, unit: str = "", scale: str = "linear",
    step: float = 0.0, joints: str = "", note: str = "", least: float = 0.0,
) -> dict[str, Any]:  # fmt: skip
    """Return a slider: its setting, words, bounds, and how it moves.

    Parameters
    ----------
    scale
        ``"linear"``, ``"log"`` (from `low`), ``"log0"``: 0 at the left end, then from `least`; or
        ``"limit"``: log, and none at the right end.
    joints
        Empty: one number. ``"same"``: a shared slider sets all joints alike; ``"factor"``: it
        multiplies what each has.
    """
    return {
        "key": key, "label": label, "low": low, "high": high, "unit": unit, "scale": scale,
        "step": step, "joints": joints, "note": note, "least": least,
    }  # fmt: skip


def control_groups(
    e: Experiment, laws: Sequence[AdaptiveFpid], starts: Sequence[dict[str, Any]]
) -> list[dict[str, Any]]:
    """Return the sliders, grouped; bounds come from the description."""
    start = starts[0]

    def most(key: str, floor: float) -> float:
        return max([floor, *(4.0 * float(x) for s in starts for x in s[key] if x < 1e299)])

    # Torques of the size that the arm needs.
    weight = np.abs(e.arm.gravity_vector(np.asarray(e.q0)))
    torque = max(float(weight.max()), 1.0)
    finite = [x for x in start["effort_limit"] if x < 1e299]
    top = 4.0 * max(finite) if finite else 40.0 * torque
    orders = [
        control("integral_order", "λ", 0, 1, step=0.001, joints="same",
                note="order of the integral"),
        control("derivative_order", "μ", 0, 1, step=0.001, joints="same",
                note="order of the derivative"),
        control("order_learning_rate", "γₒ", 0, 1, scale="log0", least=1e-5,
                note="learning rate of the orders"),
    ]  # fmt: skip
    gains = [
        control(key, label, 0, 0, scale="gain", joints="factor", note=note)
        for key, label, note in (
            ("kp", "Kp", "proportional gain at the start"),
            ("ki", "Ki", "integral gain at the start"),
            ("kd", "Kd", "derivative gain at the start"),
        )
    ]
    bound = max(supervisor_of(e, c).reference_bound for c in laws)
    watch = [
        control("supervised", "supervisor", 0, 1, scale="switch",
                note="keeps the error inside a set, with the nominal model's help"),
        control("m_x", "Mₓ", tidy(bound + 0.05), tidy(4.0 * bound + 5.0), scale="log",
                note="radius that no joint's [q, q′] may leave"),
    ]  # fmt: skip
    learning = [
        control("learning_rate", "γ", 0, 100, scale="log0", least=0.01, unit="× described",
                note="learning rate of the gains"),
        control("k0", "k₀", 0, most("k0", 10.0), unit="1/s²", joints="same", step=0.05,
                note="sliding surface, weight of ∫e"),
        control("k1", "k₁", 0, most("k1", 10.0), unit="1/s", joints="same", step=0.05,
                note="sliding surface, weight of e"),
        control("sigma", "σ", 0, 10, unit="1/s", scale="log0", least=1e-3,
                note="leakage of the gains to where they began"),
        control("dead_zone", "|S|₀", 0, 1, scale="log0", least=1e-4,
                note="no learning while |S| is below"),
    ]  # fmt: skip
    robot = [
        control("payload", "payload", 0, max(round(2.0 * torque / 9.8), 2), unit="kg", step=0.05,
                note="held by the tool; the law does not know"),
        control("viscous_friction", "viscous friction", 0, most("viscous_friction", 50.0),
                unit="N m s/rad", joints="same", scale="log0", least=1e-2),
        control("dry_friction", "dry friction", 0, most("dry_friction", torque), unit="N m",
                joints="same", scale="log0", least=1e-2),
        control("effort_limit", "effort limit", 0.02 * top, top, unit="N m", scale="limit",
                joints="factor" if finite else "same", note="where the drives clip"),
        control("knows_limit", "the law knows its limit", 0, 1, scale="switch",
                note="off: its integrals wind up"),
    ]  # fmt: skip
    outside_ = [
        control("disturbance", "disturbance", 0, most("disturbance", 2.0 * torque), unit="N m",
                scale="log0", least=0.01, joints="same", note="amplitude"),
        control("disturbance_frequency", "its frequency", 0.1, 200, unit="rad/s", scale="log"),
    ]  # fmt: skip
    if isinstance(e.reference, Sinusoid):
        outside_ += [
            control("reference_size", "motion, size", 0, 2, unit="× described", step=0.01),
            control("reference_speed", "motion, speed", 0.1, 5, unit="× described", scale="log"),
        ]
    sensors = [
        control("velocity_noise", "rate noise", 0, 1, unit="rad/s", scale="log0", least=1e-4,
                note="standard deviation"),
        control("position_noise", "angle noise", 0, 0.1, unit="rad", scale="log0", least=1e-6,
                note="standard deviation"),
        control("position_resolution", "encoder step", 0, 0.1, unit="rad", scale="log0",
                least=1e-6),
        control("differentiated", "rates from the encoder", 0, 1, scale="switch",
                note="a filtered difference of the angle"),
        control("delay", "delay", 0, min(MOST_DELAY, 60), unit="samples", step=1),
        control("step", "step", 0, 0, unit="s", scale="stops", note="sampling and integration"),
    ]  # fmt: skip
    groups = (
        ("Orders", orders), ("Gains at the start", gains), ("Learning", learning),
        ("Supervisor", watch), ("Robot", robot), ("Motion and disturbance", outside_),
        ("Sensors and clock", sensors),
    )  # fmt: skip
    return [{"name": name, "controls": controls} for name, controls in groups]
