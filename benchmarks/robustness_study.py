"""Who holds when the plant is another? Ten thousand two-links and UR5s, six laws on each.

    python benchmarks/robustness_study.py two_link|ur5 LEDGER.sqlite [--plants 10000] [--workers 2]

The three laws that adapt are tuned by one budget (40 candidates, 25 generations) on the nominal
arm and two others, noise on the rates: gains and orders; gains at the paper's orders; gains at
orders 1. The rest have the usual gains of their bandwidth, 10 rad/s. All then meet the same
plants: masses, payload, friction, push, delay, noise (see `UNCERTAIN`). Prints the table, and
what it says of the first law against the others; a ledger that is there is gone on with.
"""

from __future__ import annotations

import argparse
import dataclasses
from typing import Any

import numpy as np
from common import arm_of, on_reference, table

import fpid_pin as fp
from fpid_pin.campaign import Choices, LogUniform, Normal, Scenarios, Study, Uniform, run
from fpid_pin.campaign.statistics import paired_difference, scored, wilson
from fpid_pin.costs import MetricCost
from fpid_pin.simulation.paper import PUBLISHED_ORDERS
from fpid_pin.tuning import RobustCost, SearchSettings, Space, tune

#: Of each arm: payload and push [kg], [N m]; friction [N m s/rad].
LOADS: dict[str, tuple[float, Any, Any]] = {
    "two_link": (1.0, (4.0, 2.0), (1.0, 1.0)),
    "ur5": (3.0, (10.0, 10.0, 5.0, 0.5, 0.5, 0.05), (4.0, 4.0, 2.0, 0.5, 0.5, 0.02)),
}
BUDGET = SearchSettings(population=40, generations=25)
GAINS: dict[str, Any] = {
    "kp": (20, 400, "log", "shared"), "ki": (20, 4000, "log", "shared"),
    "kd": (8, 60, "log", "shared"), "learning_rate": (1e-3, 30, "log", "shared"),
}  # fmt: skip
ORDERS: dict[str, Any] = {
    "integral_order": (0.3, 1, "shared"), "derivative_order": (0.5, 1, "shared"),
}  # fmt: skip


def nominal(name: str) -> fp.Experiment:
    """Return what is followed: 0.4 rad at 1 rad/s around home, out of phase, from rest on it."""
    arm = arm_of(name)
    phase = np.pi / 2.0 + np.linspace(0.0, 2.0, arm.n)
    sway = fp.references.Sinusoid(0.4, 1.0, phase, arm.home)
    push = fp.disturbances.Cosine(np.array(LOADS[name][1]), 5.0)
    return fp.Experiment(
        arm, sway, **on_reference(sway), plant=fp.Plant(disturbance=push), duration=5.0,
        sensors=fp.Sensors(velocity_noise=0.01), dynamics="compiled",
    )  # fmt: skip


def uncertain(name: str) -> dict[str, Any]:
    """Return how the plants differ."""
    payload, push, friction = LOADS[name]
    return {
        "mass": Normal(mean=1.0, std=0.15),
        "payload": Uniform(low=0.0, high=payload),
        "viscous_friction": Uniform(low=0.0, high=friction),
        "disturbance_amplitude": Uniform(low=0.0, high=push),
        "disturbance_frequency": LogUniform(low=1.0, high=20.0, shared=True),
        "velocity_noise": Uniform(low=0.0, high=0.03, shared=True),
        "delay": Choices(values=(0, 1, 2)),
    }


def laws(name: str, experiment: fp.Experiment) -> dict[str, fp.Controller]:
    """Return the six laws."""
    arm, (payload, _, friction) = experiment.arm, LOADS[name]
    plants = [
        experiment.plant,
        dataclasses.replace(experiment.plant, arm=arm.with_payload(payload)),
        dataclasses.replace(experiment.plant, viscous_friction=np.array(friction)),
    ]
    training = [dataclasses.replace(experiment, plant=plant) for plant in plants]
    cost = RobustCost(MetricCost("rms_tail"), "mean")
    start = fp.suggest_gains(arm, 10.0)
    lam, mu = (float(np.mean(order)) for order in PUBLISHED_ORDERS["symbol"])
    found: dict[str, fp.Controller] = {}
    for label, orders, space in (
        ("FPID, tuned orders", {}, {**GAINS, **ORDERS}),
        ("FPID, paper's orders", {"integral_order": lam, "derivative_order": mu}, GAINS),
        ("integer PID", {"integral_order": 1.0, "derivative_order": 1.0}, GAINS),
    ):
        law = dataclasses.replace(start, **orders)
        result = tune(training, law, Space(**space), cost, BUDGET)
        print(f"{label}: {result}; {result.advice[-1]}", flush=True)
        print("  " + ", ".join(f"{k} {v:.4g}" for k, v in result.parameters.items()), flush=True)
        found[label] = dataclasses.replace(result.controller, name=label)
    found["PD + gravity"] = fp.PdGravity(kp=100.0, kd=20.0, scale="inertia")
    found["computed torque"] = fp.ComputedTorque(k0=100.0, k1=20.0)
    found["Slotine-Li"] = fp.SlotineLi(slope=10.0, damping=10.0, scale="inertia")
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("arm", choices=tuple(LOADS))
    parser.add_argument("ledger")
    parser.add_argument("--plants", type=int, default=10_000)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    experiment = nominal(options.arm)
    controllers = laws(options.arm, experiment)
    scenarios = Scenarios(uncertain(options.arm))
    study = Study(experiment, controllers, scenarios, title=f"{options.arm}: other plants")
    data = run(study, options.ledger, options.plants, workers=options.workers)
    scores = scored(data, "rms_tail")
    best = scores == scores.min(axis=1, keepdims=True)
    print(f"\n{options.arm}, {len(scores)} plants, RMS error of the last half [mrad]\n")
    rows = []
    for k, label in enumerate(data.controllers):
        rate = wilson(int(np.isfinite(scores[:, k]).sum()), len(scores))
        middle, late = 1e3 * np.quantile(scores[:, k], (0.5, 0.9), method="higher")
        first = 100.0 * float(np.mean(best[:, k] & np.isfinite(scores[:, k])))
        ahead = 100.0 * float(np.mean(scores[:, k] < scores[:, 0]))
        rows.append([label, f"{100 * rate.low:.2f} to {100 * rate.high:.2f} %", f"{middle:.3g}",
                     f"{late:.3g}", f"{first:.1f} %", f"{ahead:.1f} %"])  # fmt: skip
    heads = ["law", "success, 95 %", "median", "90 %", "best on", "less than the first on"]
    print("\n".join(table(heads, rows)))
    for k, label in enumerate(data.controllers[1:], start=1):
        apart = paired_difference(data, 0, k, "rms_tail")
        median, better = (np.array(some) for some in (apart.median, apart.better))
        told = "{:.3g} mrad in the median (95 %: {:.3g} to {:.3g})".format(*(1e3 * median))
        where = "{:.1f} % of the plants (95 %: {:.1f} to {:.1f})".format(*(100.0 * better))
        print(f"- first less {label}: {told}; better on {where}")


if __name__ == "__main__":
    main()
