"""Are the published orders any good, and does a fractional order help at all? Both, measured.

On the paper's experiment (section 5.1) with its adaptive law, costs (33) with w1 = 1 and three
weights of the energy:

- the published orders by symbol and by sign, the integer orders (1, 1), and all 16 corners of the
  square, each of which is an integer controller too;
- orders tuned by the paper's genetic algorithm, several seeds, and by differential evolution;
- fairly: an integer adaptive PID whose gains and learning rates are tuned by the same budget,
  beside an FPID whose gains, learning rates and orders are, and one more that starts from that PID.

Each is run again by RK4, with 0.05 rad/s of noise on the measured rates, and with the supervisor.

    python benchmarks/orders.py --quick
    python benchmarks/orders.py --workers 2

Every search has a checkpoint: started again it goes on, also to more generations than before.
"""

from __future__ import annotations

import argparse
import dataclasses
import itertools
from pathlib import Path
from typing import Any

import numpy as np
from common import ORDERS, Report, parameters, table, variation
from cross_check import cross_check

import fpid_pin as fp
from fpid_pin.costs import QuadraticCost
from fpid_pin.tuning import SearchSettings, Space, tune

WEIGHTS = (0.0, 1e-4, 1e-3)  # w2 of (33)
NOISE = fp.Sensors(velocity_noise=0.05)  # [rad/s]
# A factor of ten and more to either side of the paper's gains 10-25 and gamma 25.
GAINS: dict[str, Any] = {
    **dict.fromkeys(("kp", "ki", "kd"), (1, 200, "log")), "learning_rate": (1, 250, "log"),
}  # fmt: skip
SEARCHES = {
    "tuned orders": (ORDERS, "symbol"),
    "tuned integer PID": (GAINS, "integer"),
    "tuned FPID": (GAINS | ORDERS, "symbol"),
    # The integer PID is one of the FPIDs: started at the best of them, is there anything better?
    "tuned FPID, from the tuned PID": (GAINS | ORDERS, "symbol"),
}
HEADS = (
    "controller", "cost", "cost, RK4", "int e^2 [rad^2 s]", "energy [(N m)^2 s]",
    "variation [N m]", "peak [N m]", "noise: cost", "noise: torque RMS [N m]",
    "noise: variation [N m]", "supervisor",
)  # fmt: skip


def corner_name(corner: tuple[float, ...]) -> str:
    return "corner lambda ({:g}, {:g}), mu ({:g}, {:g})".format(*corner)


def fixed_controllers() -> dict[str, fp.AdaptiveFpid]:
    """Return the published orders, read both ways, and the 16 integer controllers."""
    named = {
        "published, by symbol": fp.paper_controller("symbol", supervised=False),
        "published, by sign": fp.paper_controller("sign", supervised=False),
    }
    base = named["published, by symbol"]
    for corner in itertools.product((1.0, 0.0), repeat=4):
        named[corner_name(corner)] = dataclasses.replace(
            base, integral_order=corner[:2], derivative_order=corner[2:], name=""
        )
    return named


def measure(
    experiment: fp.Experiment, named: dict[str, fp.AdaptiveFpid], cost: QuadraticCost
) -> tuple[list[list[str]], dict[str, float]]:
    """Return a row a controller: exact sensors, RK4, noise, supervisor; and its cost by RK4."""
    laws = list(named.values())
    guard = fp.paper_controller().supervisor
    clean = fp.simulate(experiment, laws)
    rk4 = fp.evaluate(dataclasses.replace(experiment, integrator="rk4"), laws, cost)
    noisy = fp.simulate(dataclasses.replace(experiment, sensors=NOISE, seed=1), laws)
    watched = fp.evaluate(
        experiment, [dataclasses.replace(law, supervisor=guard) for law in laws], cost
    )
    rows, costs = [], {}
    for name, run, other, by_rk4, guarded in zip(named, clean, noisy, rk4, watched, strict=True):
        costs[name] = float(by_rk4) if run.outcome.completed else np.inf
        if not run.outcome.completed:
            rows.append([name, "inf", str(run.outcome), *[""] * (len(HEADS) - 3)])
            continue
        m, own = run.metrics, cost.of(run.metrics)
        numbers = [own, by_rk4, m.ise.sum(), m.energy.sum(), variation(run), m.peak_torque.max()]
        if other.outcome.completed:
            reaction = np.sqrt(np.mean((other.torque - run.torque) ** 2))
            numbers += [cost.of(other.metrics), reaction, variation(other)]
        cells = [f"{x:.4g}" for x in numbers] + [""] * (9 - len(numbers))
        rows.append([name, *cells, "silent" if guarded == own else f"acts, cost {guarded:.4g}"])
    return rows, costs


def one_weight(w2: float, experiment: fp.Experiment, options: argparse.Namespace) -> None:
    """Report all searches and runs for one weight."""
    report, cost, named = options.report, QuadraticCost(1.0, w2), fixed_controllers()
    report.add(f"## w2 = {w2:g}", "")
    for title, (genes, orders) in SEARCHES.items():
        slug = f"{title.replace(',', '').replace(' ', '-')}-w2-{w2:g}.npz"
        settings = SearchSettings(
            population=options.population, generations=options.generations, seeds=options.seeds,
            initial=[named["tuned integer PID"]] if "from" in title else [],
            workers=options.workers, checkpoint=options.checkpoints / slug, resume=True,
        )  # fmt: skip
        base = fp.paper_controller(orders, supervised=False)
        result = tune(experiment, base, Space(**genes), cost, settings)
        named[title] = result.controller
        report.add(
            f"- {title}: {result.cost:.5g} (seeds: {', '.join(f'{c:.5g}' for c in result.costs)}), "
            f"{result.evaluations} evaluations: {parameters(result.controller, genes)}"
        )
    settings = SearchSettings(
        population=options.population, generations=options.generations, workers=options.workers
    )
    base = fp.paper_controller(supervised=False)
    law, least, _ = cross_check(experiment, base, Space(**ORDERS), cost, settings)
    named["orders by differential evolution"] = law
    rows, costs = measure(experiment, named, cost)
    corners = [name for name in costs if name.startswith("corner")]
    best = min(corners, key=costs.__getitem__)
    tuned, pid = costs["tuned orders"], costs["tuned integer PID"]
    parts = {
        "integer orders (1, 1)": tuned / costs[corner_name((1, 1, 1, 1))],
        "the published by symbol": tuned / costs["published, by symbol"],
        "by sign": tuned / costs["published, by sign"],
        f"the best {best}": tuned / costs[best],
    }
    report.add(
        f"- orders by differential evolution: {least:.5g}: {parameters(law, ORDERS)}",
        "- by RK4, tuned orders against "
        + "; ".join(f"{name}: {part:.3f}" for name, part in parts.items()),
        f"- by RK4, tuned FPID against tuned integer PID: {costs['tuned FPID'] / pid:.3f}, started "
        f"from it {costs['tuned FPID, from the tuned PID'] / pid:.3f}",
        "",
        *table(HEADS, rows),
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a look only; nothing written")
    parser.add_argument("--population", type=int, default=60)
    parser.add_argument("--generations", type=int, default=80)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--workers", type=int)
    parser.add_argument("--weights", type=float, nargs="+", default=list(WEIGHTS))
    parser.add_argument("--checkpoints", type=Path, default=Path("runs/orders"))
    options = parser.parse_args()
    experiment = fp.paper_experiment()
    if options.quick:
        options.population, options.generations, options.seeds = 16, 6, [0, 1]
        options.checkpoints = options.checkpoints / "quick"
        experiment = fp.paper_experiment(duration=4.0, step=2e-3)
    # One dynamics for all: a supervisor that is silent changes no bit of it.
    experiment = experiment.with_dynamics("compiled")
    options.report = Report(
        f"{options.population} candidates x {options.generations} generations, seeds "
        f"{options.seeds}, {experiment.duration:g} s at {1e3 * experiment.step:g} ms. Searches run "
        "without the supervisor; the last column says whether it would have acted.",
        "",
    )
    for w2 in options.weights:
        one_weight(w2, experiment, options)
    if not options.quick:
        options.report.write("orders.md", "# Orders")


if __name__ == "__main__":
    main()
