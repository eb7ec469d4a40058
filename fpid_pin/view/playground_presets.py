"""Settings that teach: what to move, what to pin beside it, and what to look for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.paper import PUBLISHED_ORDERS, TUNED_ORDERS, of_paper


def presets(
    e: Experiment, start: dict[str, Any], steps: Sequence[float], peak: Sequence[float],
    bound: float, kind: str,
) -> list[dict[str, Any]]:  # fmt: skip
    """Return the presets of a page: name, text, settings now and pinned.

    Parameters
    ----------
    e, start, steps
        The experiment, the settings of its first controller, and the steps on offer [s].
    peak
        Largest torque of the described run, (n,) [N m]: loads and limits are sized by it.
    bound, kind
        sup ||[q_d, q'_d]|| of the reference, by which the supervisor's set is sized; its kind.
    """
    n = e.arm.n
    whole = {"integral_order": [1.0] * n, "derivative_order": [1.0] * n}
    # The paper's orders, and those tuned for it, mean something on its arm alone.
    ours = of_paper(e.arm)
    printed = _orders(PUBLISHED_ORDERS["symbol"]) if ours else {}
    noisy = {"velocity_noise": 0.05}
    tight = {"effort_limit": [_round(0.6 * u) for u in peak]}
    weight = np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max()
    load = {"payload": _round(max(float(weight) / 9.8 * 0.25, 0.5))}
    slow = max(steps)
    late = next((h for h in steps if h >= 10.0 * e.step), slow)
    drift = {"learning_rate": 4.0, "velocity_noise": 0.05}
    push = {"disturbance": [_round(0.8 * u) for u in peak], "disturbance_frequency": 3.0}
    close = _round(bound * 1.3 + 0.3)
    stiff = {
        "viscous_friction": [_round(0.5 * u) for u in peak],
        "dry_friction": [_round(0.15 * u) for u in peak],
    }

    def preset(
        name: str, text: str, now: dict[str, Any], pinned: dict[str, Any] | None = None
    ) -> dict[str, Any]:
        return {"name": name, "text": text, "now": now, "pinned": pinned}

    found = [
        preset("As described", "The run as it was described.", {}),
        preset(
            "Integer against fractional",
            "Dashed: the same law with orders 1, an adaptive PID. The table says what the "
            "fractional orders cost or gain; move λ and μ from there.",
            printed, printed | whole,
        ),
        preset(
            "Derivative order and noise",
            "The rates are noisy. Dashed: μ = 1, which passes all of it on. A smaller μ makes "
            "calmer torques; see what it costs in error.",
            noisy | {"derivative_order": [0.7] * n}, noisy | {"derivative_order": [1.0] * n},
        ),
        preset(
            "Saturation and wind-up",
            "The drives give six tenths of the torque that was needed, and the law is not told: "
            "integrals and gains wind up. Dashed: the law knows, and holds them.",
            tight | {"knows_limit": False}, tight | {"knows_limit": True},
        ),
        preset(
            "Payload",
            "The tool holds a mass that the law knows nothing of; watch the gains take it up. "
            "Dashed: without it.",
            load, {},
        ),
        preset(
            "Drift and safeguards",
            "Noise and fast learning: Kp, Ki and Kd drift upwards for ever (dashed). Leakage σ "
            "pulls them back to where they began.",
            drift | {"sigma": 0.2}, drift,
        ),
        preset(
            "Stiff friction",
            "Viscous friction far too stiff for an explicit rule, and dry friction that sticks at "
            "each turn: both are solved implicitly. Dashed: without friction.",
            stiff, {"viscous_friction": [0.0] * n, "dry_friction": [0.0] * n},
        ),
        preset(
            "Orders that learn",
            "λ and μ move along the same gradient as the gains: choose λ or μ in the third plot. "
            "Dashed: they stay.",
            {"order_learning_rate": 0.01 if n == 2 else 0.001}, {},
        ),
    ]  # fmt: skip
    found.append(preset(
        "The supervisor",
        "The paper's supervisor under a hard load: its sign, held for a whole step, makes the "
        "torque chatter, and gains stand still while it acts. Dashed: without it. Raise Mₓ."
        if kind == "paper"
        else "A hard load. The supervisor steps in where the error would leave its set: Mₓ says "
        "how large that is. Dashed: without it.",
        {**push, "supervised": True, "m_x": close}, {**push, "supervised": False},
    ))  # fmt: skip
    if ours:
        found[2:2] = [
            preset(
                "The published orders, read twice",
                "The paper prints a minus sign before μ: read by symbol, and (dashed) by sign, "
                "which swaps the two.",
                printed, _orders(PUBLISHED_ORDERS["sign"]),
            ),
            preset(
                "Tuned orders",
                "The orders that a search finds for the paper's gains: joint 2 does without an "
                "integral. Dashed: the published ones.",
                _orders(TUNED_ORDERS), printed,
            ),
        ]  # fmt: skip
    if late > e.step:
        found.insert(-1, preset(
            "Too long a step",
            "The loop runs ten times slower and more. Dashed: as described. Halve the step until "
            "it holds.",
            {"step": slow}, {},
        ))  # fmt: skip
    return found


def _orders(pair: Sequence[Sequence[float]]) -> dict[str, Any]:
    return {"integral_order": list(pair[0]), "derivative_order": list(pair[1])}


def _round(x: float) -> float:
    return float(f"{x:.2g}")
