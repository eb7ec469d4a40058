"""What `adaptive_orders.py` compares: starts, rates, safeguards, sensors, jobs; and its tables."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
from arms import around_home

import fpid_pin as fp
from fpid_pin.control import adapt_orders
from fpid_pin.costs import QuadraticCost
from fpid_pin.references import Hold

COST = QuadraticCost(1.0, 1e-4)
TWO_LINK = fp.Arm.two_link()
PAPER = fp.paper_controller(supervised=False)
STARTS: dict[str, dict[str, Any]] = {
    "published, (0.90, 0.93), (0.92, 0.93)": {},
    "integer, 1, 1": {"integral_order": 1.0, "derivative_order": 1.0},
    "0.5, 0.7": {"integral_order": 0.5, "derivative_order": 0.7},
    "0.1, 0.4": {"integral_order": 0.1, "derivative_order": 0.4},
    "no integral, 0.02, 1": {"integral_order": 0.02, "derivative_order": 1.0},
    "little damping, 1, 0.3": {"integral_order": 1.0, "derivative_order": 0.3},
}
RATES = (0.0, 0.01, 0.1, 0.3, 1.0, 3.0)
GUARDS = {
    "none": None,
    "dead zone 0.1": fp.Safeguards(dead_zone=0.1),
    "leakage 0.03 1/s": fp.Safeguards(sigma=0.03),
}
SENSORS = {
    "white, 0.05 rad/s": fp.Sensors(velocity_noise=0.05),
    "differentiated from angles with 0.1 mrad": fp.Sensors(
        position_noise=1e-4, velocity="differentiated"
    ),
    "white, 0.05 rad/s, 2 ms late": fp.Sensors(velocity_noise=0.05, delay=2),
}


def moving(law: fp.AdaptiveFpid, rate: Any, **changes: Any) -> fp.AdaptiveFpid:
    """Return a law with orders that move within their widest bounds."""
    return dataclasses.replace(law, order_learning_rate=rate, **changes)


def unbounded(law: fp.AdaptiveFpid, arm: fp.Arm) -> fp.AdaptiveFpid:
    """Return a law with the rates of `adapt_orders` and the widest bounds."""
    return moving(law, adapt_orders(law, arm).order_learning_rate)


def table(heads: list[str], rows: list[list[str]], text: int = 1) -> list[str]:
    """Return a Markdown table whose first `text` columns are words."""
    marks = ["---"] * text + ["---:"] * (len(heads) - text)
    return [f"| {' | '.join(row)} |" for row in (heads, marks, *rows)] + [""]


def tail(run: fp.Run) -> float:
    """Return the RMS of the last half over all joints [mrad]."""
    return 1e3 * float(np.sqrt((run.metrics.rms_tail**2).mean()))


def variation(run: fp.Run) -> float:
    return float(run.metrics.total_variation.sum())


def jobs(arm: fp.Arm, duration: float) -> dict[str, fp.Experiment]:
    """Return what an arm with suggested gains is asked to do."""
    base = fp.Experiment(arm, around_home(arm), duration=duration)
    heavy = fp.Plant(arm=arm.with_payload(3.0))
    return {
        "0.3 rad at 1 rad/s": base,
        "with 3 kg": dataclasses.replace(base, plant=heavy),
        "at 2 rad/s": dataclasses.replace(base, reference=around_home(arm, 0.3, 2.0)),
        "noise 0.05 rad/s": dataclasses.replace(base, sensors=SENSORS["white, 0.05 rad/s"], seed=1),
        "hold a pose": dataclasses.replace(base, reference=Hold(arm.home + 0.3), q0=arm.home),
    }


def draw(path: Path, experiment: fp.Experiment) -> None:
    """Draw the orders over time, from every start, at a slow rate and by the rule."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(
        4, 2, figsize=(11, 8), sharex=True, sharey=True, constrained_layout=True
    )
    for k, (name, start) in enumerate(STARTS.items()):
        law = dataclasses.replace(PAPER, **start)
        for column, moved in enumerate((moving(law, 0.1), unbounded(law, TWO_LINK))):
            run = fp.simulate(experiment, moved)
            for row, (order, joint) in enumerate(
                (order, j) for order in ("integral_order", "derivative_order") for j in (0, 1)
            ):
                axes[row, column].plot(
                    run.t[::20], run.signals[order][::20, joint], color=f"C{k}", label=name,
                    linewidth=1.0,
                )  # fmt: skip
                symbol = r"\lambda" if order.startswith("i") else r"\mu"
                axes[row, 0].set_ylabel(f"${symbol}_{joint + 1}$")
    for panel, title in zip(axes[0], ("rate 0.1", "rates by the rule"), strict=True):
        panel.set_title(title)
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=110)
