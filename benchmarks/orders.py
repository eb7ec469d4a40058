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
import os
import platform
import time
from pathlib import Path
from typing import Any

import numpy as np
from cross_check import cross_check

import fpid_pin as fp
from fpid_pin.costs import QuadraticCost
from fpid_pin.tuning import (
    SearchProgress,
    SearchSettings,
    Space,
    TuningResult,
    tune,
)

WEIGHTS = (0.0, 1e-4, 1e-3)  # w2 of (33)
NOISE = fp.Sensors(velocity_noise=0.05)  # [rad/s]
ORDERS = {"integral_order": (0, 1), "derivative_order": (0, 1)}
# A factor of ten and more to either side of the paper's gains 10-25 and gamma 25.
GAINS: dict[str, Any] = {
    "kp": (1, 200, "log"),
    "ki": (1, 200, "log"),
    "kd": (1, 200, "log"),
    "learning_rate": (1, 250, "log"),
}
SEARCHES = {
    "tuned orders": (ORDERS, "symbol"),
    "tuned integer PID": (GAINS, "integer"),
    "tuned FPID": (GAINS | ORDERS, "symbol"),
    # The integer PID is one of the FPIDs: started at the best of them, is there anything better?
    "tuned FPID, from the tuned PID": (GAINS | ORDERS, "symbol"),
}


def corner_name(corner: tuple[float, ...]) -> str:
    a, b, c, d = (int(x) for x in corner)
    return f"corner lambda ({a}, {b}), mu ({c}, {d})"


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


class Line:
    """Says how a search gets on, a line every few seconds."""

    def __init__(self, title: str) -> None:
        self._title, self._last = title, 0.0

    def __call__(self, progress: SearchProgress) -> None:
        if progress.rate > 0.0 and time.monotonic() - self._last > 20.0:
            self._last = time.monotonic()
            print(
                f"{self._title}: generation {progress.generation} of {progress.generations}, "
                f"best {progress.best:.5g}, {progress.rate:.1f} evaluations/s, "
                f"{progress.seconds_left:.0f} s left",
                flush=True,
            )


def measure(
    experiment: fp.Experiment, named: dict[str, fp.AdaptiveFpid], w2: float
) -> list[dict[str, Any]]:
    """One row a controller: exact sensors, RK4, noise, and the supervisor standing by."""
    controllers = list(named.values())
    cost = QuadraticCost(1.0, w2)
    supervisor = fp.paper_controller().supervisor
    clean = fp.simulate(experiment, controllers)
    rk4 = fp.evaluate(dataclasses.replace(experiment, integrator="rk4"), controllers, cost)
    noisy = fp.simulate(dataclasses.replace(experiment, sensors=NOISE, seed=1), controllers)
    watched = fp.evaluate(
        experiment, [dataclasses.replace(c, supervisor=supervisor) for c in controllers], cost
    )
    rows = []
    for k, name in enumerate(named):
        row: dict[str, Any] = {"controller": name}
        if not clean[k].outcome.completed:
            rows.append(row | {"cost": np.inf, "outcome": str(clean[k].outcome)})
            continue
        m = clean[k].metrics
        row |= {
            "cost": cost.of(m),
            "cost, RK4": float(rk4[k]),
            "int e^2 [rad^2 s]": float(m.ise.sum()),
            "energy [(N m)^2 s]": float(m.energy.sum()),
            "variation [N m]": float(m.total_variation.sum()),
            "peak [N m]": float(m.peak_torque.max()),
        }
        if noisy[k].outcome.completed:
            reaction = noisy[k].torque - clean[k].torque
            row |= {
                "noise: cost": cost.of(noisy[k].metrics),
                "noise: torque RMS [N m]": float(np.sqrt(np.mean(reaction**2))),
                "noise: variation [N m]": float(noisy[k].metrics.total_variation.sum()),
            }
        else:
            row |= {"noise: cost": np.inf}
        same = watched[k] == cost.of(m)
        row["supervisor"] = "silent" if same else f"acts, cost {watched[k]:.4g}"
        rows.append(row)
    return rows


def markdown(rows: list[dict[str, Any]]) -> str:
    heads = list(dict.fromkeys(head for row in rows for head in row))
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" + " ---: |" * (len(heads) - 1)]
    for row in rows:
        cells = [row.get(head, "") for head in heads]
        texts = [f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in cells]
        lines.append("| " + " | ".join(texts) + " |")
    return "\n".join(lines) + "\n"


def parameters_of(controller: Any, names: list[str]) -> str:
    parts = []
    for name in names:
        values = np.atleast_1d(getattr(controller, name))
        parts.append(f"{name} ({', '.join(f'{v:.3g}' for v in values)})")
    return ", ".join(parts)


def at_bounds(result: TuningResult, base: fp.AdaptiveFpid, genes: dict[str, Any]) -> str:
    """Say which parameters want to go where the space does not let them."""
    bound = Space(**genes).bind(base, 2)
    at = bound.point(result.controller, 2)
    stuck = [label for label, x in zip(bound.labels, at, strict=True) if not 0.01 < x < 0.99]
    return f"; at a bound: {', '.join(stuck)}" if stuck else ""


def one_weight(
    w2: float, experiment: fp.Experiment, options: argparse.Namespace, folder: Path
) -> tuple[str, dict[str, float]]:
    """All searches and runs for one weight: a section of the report, and the costs."""
    cost = QuadraticCost(1.0, w2)
    named = fixed_controllers()
    notes = []
    for title, (genes, orders) in SEARCHES.items():
        base = fp.paper_controller(orders, supervised=False)
        slug = f"{title.replace(',', '').replace(' ', '-')}-w2-{w2:g}.npz"
        start = [named["tuned integer PID"]] if "from" in title else []
        began = time.perf_counter()
        result = tune(
            experiment,
            base,
            Space(**genes),
            cost,
            SearchSettings(
                population=options.population,
                generations=options.generations,
                seeds=options.seeds,
                initial=start,
                workers=options.workers,
                checkpoint=folder / slug,
                resume=True,
            ),
            progress=Line(f"w2 = {w2:g}, {title}"),
        )
        named[title] = result.controller
        spread = ", ".join(f"{c:.5g}" for c in result.costs)
        notes.append(
            f"- {title}: {result.cost:.5g} (seeds: {spread}; mean {result.mean:.5g}, standard "
            f"deviation {result.spread:.2g}), {result.evaluations} evaluations, "
            f"{time.perf_counter() - began:.0f} s in this process: "
            f"{parameters_of(result.controller, list(genes))}{at_bounds(result, base, genes)}"
        )
        print(notes[-1], flush=True)
    if not options.no_cross_check:
        law, cost_found, evaluations = cross_check(
            experiment,
            fp.paper_controller(supervised=False),
            Space(**ORDERS),
            cost,
            SearchSettings(
                population=options.population,
                generations=options.generations,
                workers=options.workers,
            ),
        )
        named["orders by differential evolution"] = law
        notes.append(
            f"- orders by differential evolution: {cost_found:.5g}, {evaluations} "
            f"evaluations: {parameters_of(law, list(ORDERS))}"
        )
        print(notes[-1], flush=True)
    rows = measure(experiment, named, w2)
    costs = {row["controller"]: row.get("cost, RK4", row["cost"]) for row in rows}
    corners = {name: c for name, c in costs.items() if name.startswith("corner")}
    best = min(corners, key=lambda name: corners[name])
    tuned = costs["tuned orders"]
    notes += [
        f"- tuned orders against integer orders (1, 1): "
        f"{tuned / costs[corner_name((1, 1, 1, 1))]:.3f}; against the published: "
        f"{tuned / costs['published, by symbol']:.3f} by symbol, "
        f"{tuned / costs['published, by sign']:.3f} by sign; against the best corner "
        f"({best.removeprefix('corner ')}): {tuned / corners[best]:.3f} (by RK4)",
        f"- tuned FPID against tuned integer PID: "
        f"{costs['tuned FPID'] / costs['tuned integer PID']:.3f}, started from it "
        f"{costs['tuned FPID, from the tuned PID'] / costs['tuned integer PID']:.3f} (by RK4)",
    ]
    return f"## w2 = {w2:g}\n\n" + "\n".join(notes) + "\n\n" + markdown(rows), costs


def arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("--quick", action="store_true", help="16 x 6, 4 s at 2 ms: a look only")
    parser.add_argument("--population", type=int, default=60)
    parser.add_argument("--generations", type=int, default=80)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2])
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--weights", type=float, nargs="+", default=list(WEIGHTS))
    parser.add_argument("--no-cross-check", action="store_true")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results" / "orders.md")
    parser.add_argument("--checkpoints", type=Path, default=Path("runs/orders"))
    options = parser.parse_args()
    if options.quick:
        options.population, options.generations, options.seeds = 16, 6, [0, 1]
        options.checkpoints = options.checkpoints / "quick"
    return options


def main() -> None:
    options = arguments()
    short = {"duration": 4.0, "step": 2e-3} if options.quick else {}
    experiment = fp.paper_experiment(**short)
    began = time.perf_counter()
    sections = []
    for w2 in options.weights:
        text, _ = one_weight(w2, experiment, options, options.checkpoints)
        sections.append(text)
        heading = (
            "# Orders\n\n"
            f"`python benchmarks/orders.py`: {options.population} candidates x "
            f"{options.generations} generations, seeds {options.seeds}, {experiment.duration:g} s "
            f"at {1e3 * experiment.step:g} ms, semi-implicit Euler; fpid_pin {fp.__version__}, "
            f"Python {platform.python_version()}, {os.cpu_count()} cores, "
            f"{time.perf_counter() - began:.0f} s. Searches run without the supervisor; the last "
            "column says whether it would have acted.\n\n"
        )
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(heading + "\n".join(sections), encoding="utf-8")
    print(options.out.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
