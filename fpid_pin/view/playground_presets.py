"""Settings that teach: what to move, what to pin beside it, and what to look for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.paper import PUBLISHED_ORDERS, TUNED_ORDERS, of_paper
from fpid_pin.view.playground_law import Law, supervisor_of


def presets(
    e: Experiment, laws: Sequence[Law], steps: Sequence[float], peak: Sequence[float]
) -> list[dict[str, Any]]:
    """Return the presets of a page: name, text, settings now and pinned.

    Those about a law are about the first adaptive FPID; without one they are left out.

    Parameters
    ----------
    e, laws, steps
        The experiment, what is on the page, and the steps on offer [s].
    peak
        Largest torque of the described run, (n,) [N m]: loads and limits are sized by it.
    """
    n = e.arm.n
    fpid = next((k for k, x in enumerate(laws) if isinstance(x.controller, AdaptiveFpid)), None)
    index = fpid or 0
    supervisor = supervisor_of(e, laws[index].controller)

    def part(factor: float) -> list[float]:
        return [_round(factor * u) for u in peak]

    def orders(pair: Sequence[Sequence[float]]) -> dict[str, Any]:
        return {"integral_order": list(pair[0]), "derivative_order": list(pair[1])}

    found: list[dict[str, Any]] = []

    def preset(
        name: str, text: str, now: dict[str, Any], pinned: dict[str, Any] | None = None
    ) -> None:
        own = {*laws[index].settings, "supervised", "m_x"}

        def settings(some: dict[str, Any]) -> dict[str, Any]:
            prefixed = {f"{index}.{key}" if key in own else key: x for key, x in some.items()}
            return {"controller": index, **prefixed}

        pins = None if pinned is None else settings(pinned)
        found.append({"name": name, "text": text, "now": settings(now), "pinned": pins})

    # The paper's orders, and those tuned for it, mean something on its arm alone.
    ours = of_paper(e.arm)
    printed = orders(PUBLISHED_ORDERS["symbol"]) if ours else {}
    preset("As described", "The run as it was described.", {})
    if len(laws) > 1:
        preset(
            "All laws side by side",
            "Each law as it was described, in a colour of its own. Move the robot, the noise or "
            "the disturbance: they all meet the same.",
            {"beside": [k for k in range(len(laws)) if k != index]},
        )
    if fpid is not None:
        preset(
            "Integer against fractional",
            "Dashed: the same law with orders 1, an adaptive PID. The table says what the "
            "fractional orders cost or gain; move λ and μ from there.",
            printed, printed | orders([[1.0] * n] * 2),
        )  # fmt: skip
    if fpid is not None and ours:
        preset(
            "The published orders, read twice",
            "The paper prints a minus sign before μ: read by symbol, and (dashed) by sign, "
            "which swaps the two.",
            printed, orders(PUBLISHED_ORDERS["sign"]),
        )  # fmt: skip
        preset(
            "Tuned orders",
            "The orders that a search finds for the paper's gains: joint 2 does without an "
            "integral. Dashed: the published ones.",
            orders(TUNED_ORDERS), printed,
        )  # fmt: skip
    noisy = {"velocity_noise": 0.05}
    if fpid is not None:
        preset(
            "Derivative order and noise",
            "The rates are noisy. Dashed: μ = 1, which passes all of it on. A smaller μ makes "
            "calmer torques; see what it costs in error.",
            noisy | {"derivative_order": [0.7] * n}, noisy | {"derivative_order": [1.0] * n},
        )  # fmt: skip
    tight = {"effort_limit": part(0.6)}
    preset(
        "Saturation and wind-up",
        "The drives give six tenths of the torque that was needed, and the law is not told: "
        "what integrates winds up. Dashed: the law knows, and holds it.",
        tight | {"knows_limit": False}, tight | {"knows_limit": True},
    )  # fmt: skip
    weight = float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max())
    preset(
        "Payload",
        "The tool holds a mass that the law knows nothing of; watch what the law makes of it. "
        "Dashed: without it.",
        {"payload": _round(max(weight / 9.8 * 0.25, 0.5))}, {},
    )  # fmt: skip
    if fpid is not None:
        drift = noisy | {"learning_rate": 4.0}
        preset(
            "Drift and safeguards",
            "Noise and fast learning: Kp, Ki and Kd drift upwards for ever (dashed). Leakage σ "
            "pulls them back to where they began.",
            drift | {"sigma": 0.2}, drift,
        )  # fmt: skip
    preset(
        "Stiff friction",
        "Viscous friction far too stiff for an explicit rule, and dry friction that sticks at "
        "each turn: both are solved implicitly. Dashed: without friction.",
        {"viscous_friction": part(0.5), "dry_friction": part(0.15)},
        {"viscous_friction": [0.0] * n, "dry_friction": [0.0] * n},
    )
    if fpid is not None:
        preset(
            "Orders that learn",
            "λ and μ move along the same gradient as the gains: choose λ or μ in the third plot. "
            "Dashed: they stay.",
            {"order_learning_rate": 0.01 if n == 2 else 0.001}, {},
        )  # fmt: skip
    late = next((h for h in steps if h >= 10.0 * e.step), max(steps))
    if late > e.step:
        preset(
            "Too long a step",
            "The loop runs ten times slower and more. Dashed: as described. Halve the step until "
            "it holds.",
            {"step": max(steps)}, {},
        )  # fmt: skip
    push = {"disturbance": part(0.8), "disturbance_frequency": 3.0}
    close = _round(supervisor.reference_bound * 1.3 + 0.3)
    preset(
        "The supervisor",
        "The paper's supervisor under a hard load: its sign, held for a whole step, makes the "
        "torque chatter, and gains stand still while it acts. Dashed: without it. Raise Mₓ."
        if supervisor.kind == "paper"
        else "A hard load. The supervisor steps in where the error would leave its set: Mₓ says "
        "how large that is. Dashed: without it.",
        {**push, "supervised": True, "m_x": close}, {**push, "supervised": False},
    )  # fmt: skip
    return found


def _round(x: float) -> float:
    return float(f"{x:.2g}")
