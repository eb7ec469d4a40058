"""Settings that teach: what to move, what to pin beside it, and what to look for."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin.control.fpid import AdaptiveFpid
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.paper import PUBLISHED_ORDERS, TUNED_ORDERS, of_paper
from fpid_pin.view.document import asset
from fpid_pin.view.playground_law import Law
from fpid_pin.view.playground_settings import rounded

#: Settings, and those of the run that is pinned beside it; None: nothing is pinned.
Pair = tuple[dict[str, Any], dict[str, Any] | None]


def presets(
    e: Experiment, laws: Sequence[Law], steps: Sequence[float], peak: Sequence[float]
) -> list[dict[str, Any]]:
    """Return the presets of a page: name, text, settings now and pinned.

    Those about a law are about the first adaptive FPID; without one they are left out. Texts are
    in ``assets/playground_presets.csv``.

    Parameters
    ----------
    e, laws, steps
        The experiment, what is on the page, and the steps on offer [s].
    peak
        Largest torque of the described run, (n,) [N m]: loads and limits are sized by it.
    """
    n = e.arm.n
    fpids = [k for k, x in enumerate(laws) if isinstance(x.controller, AdaptiveFpid)]
    index = fpids[0] if fpids else 0
    supervisor = laws[index].supervisor

    def part(factor: float) -> list[float]:
        return [rounded(factor * u, 2) for u in peak]

    tight, none = {"effort_limit": part(0.6)}, [0.0] * n
    weight = float(np.abs(e.arm.gravity_vector(np.asarray(e.q0))).max())
    push = {"disturbance": part(0.8), "disturbance_frequency": 3.0}
    close = rounded(supervisor.reference_bound * 1.3 + 0.3, 2)
    paper = supervisor.kind == "paper"
    found: dict[str, Pair] = {
        "As described": ({}, None),
        "Saturation and wind-up": (tight | {"knows_limit": False}, tight | {"knows_limit": True}),
        "Payload": ({"payload": rounded(max(weight / 9.8 * 0.25, 0.5), 2)}, {}),
        "Stiff friction": (
            {"viscous_friction": part(0.5), "dry_friction": part(0.15)},
            {"viscous_friction": none, "dry_friction": none},
        ),
        "The supervisor" if paper else "The supervisor for sampled loops": (
            push | {"supervised": True, "m_x": close}, push | {"supervised": False},
        ),
    }  # fmt: skip
    if len(laws) > 1:
        others = [k for k in range(len(laws)) if k != index]
        found["All laws side by side"] = ({"beside": others}, None)
    if max(steps) > e.step:
        found["Too long a step"] = ({"step": max(steps)}, {})
    if fpids:
        found |= _of_fpid(of_paper(e.arm), n)
    own = {*laws[index].settings, "supervised", "m_x"}

    def settings(some: dict[str, Any] | None) -> dict[str, Any] | None:
        if some is None:
            return None
        prefixed = {f"{index}.{key}" if key in own else key: x for key, x in some.items()}
        return {"controller": index, **prefixed}

    rows = csv.DictReader(asset("playground_presets.csv").splitlines())
    return [
        row | {"now": settings(found[row["name"]][0]), "pinned": settings(found[row["name"]][1])}
        for row in rows
        if row["name"] in found
    ]


def _of_fpid(ours: bool, n: int) -> dict[str, Pair]:
    """Return what teaches about an adaptive FPID; `ours`: on the paper's arm."""

    def orders(pair: Sequence[Sequence[float]]) -> dict[str, Any]:
        return {"integral_order": list(pair[0]), "derivative_order": list(pair[1])}

    # The paper's orders, and those tuned for it, mean something on its arm alone.
    printed = orders(PUBLISHED_ORDERS["symbol"]) if ours else {}
    noisy = {"velocity_noise": 0.05}
    drift = noisy | {"learning_rate": 4.0}
    found: dict[str, Pair] = {
        "Integer against fractional": (printed, printed | orders([[1.0] * n] * 2)),
        "Derivative order and noise": (
            noisy | {"derivative_order": [0.7] * n}, noisy | {"derivative_order": [1.0] * n},
        ),
        "Drift and safeguards": (drift | {"sigma": 0.2}, drift),
        "Orders that learn": ({"order_learning_rate": 0.01 if n == 2 else 0.001}, {}),
    }  # fmt: skip
    if ours:
        found["The published orders, read twice"] = (printed, orders(PUBLISHED_ORDERS["sign"]))
        found["Tuned orders"] = (orders(TUNED_ORDERS), printed)
    return found
