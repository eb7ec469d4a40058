"""Are the published orders any good?

On the paper's experiment (section 5.1) with its adaptive law, costs (33) with w1 = 1 and three
weights of the energy: the published orders by symbol and by sign, integer orders (1, 1), and all 16
corners of the square, each of which is an integer controller too; orders tuned by the paper's
genetic algorithm and by differential evolution; and fairly, an integer adaptive PID whose gains and
learning rates are tuned by the same budget, beside an FPID whose gains, learning rates and orders
are, and one more that starts from that PID. Each again by RK4, with 0.05 rad/s of noise on the
measured rates, and with the supervisor. Searches have checkpoints in runs/orders: started again
they go on.
"""

import itertools
import math
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from common import Bench, parameters, run, variation
from scipy.optimize import differential_evolution

import fpid_pin as fp
from fpid_pin.costs import Cost, QuadraticCost
from fpid_pin.tuning import SearchSettings, Space, tune

NOISE = fp.Sensors(velocity_noise=0.05)  # [rad/s]
ORDERS: dict[str, Any] = {"integral_order": (0, 1), "derivative_order": (0, 1)}
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
PAPER = fp.paper_controller(supervised=False)


def paper_experiment(bench: Bench) -> fp.Experiment:
    """Return section 5.1 by compiled dynamics: one dynamics for all that is compared."""
    short = {"duration": 4.0, "step": 2e-3} if bench.quick else {}
    return fp.paper_experiment(**short).with_dynamics("compiled")


def budget(bench: Bench, **more: Any) -> SearchSettings:
    """Return what every search may spend."""
    small = {"population": 12, "generations": 2, "seeds": (0,)}
    whole = {"population": 60, "generations": 80, "seeds": (0, 1, 2)}
    size = small if bench.quick else whole
    return SearchSettings(**size, workers=bench.workers, **more)


def differential(bench: Bench, cost: Cost) -> tuple[fp.Controller, float]:
    """Search orders by another optimiser: if it finds something better, the first one failed.

    Differential evolution (Storn and Price 1997); the best law of all seeds, and its cost.
    """
    experiment, settings = paper_experiment(bench), budget(bench)
    bound = Space(**ORDERS).bind(PAPER, experiment.arm.n)

    def costs(columns: np.ndarray) -> np.ndarray:
        laws = [bound.controller(point) for point in columns.T]
        return fp.evaluate(experiment, laws, cost, workers=bench.workers)

    ends = [
        differential_evolution(
            costs, [(0.0, 1.0)] * bound.size, popsize=math.ceil(settings.population / bound.size),
            maxiter=settings.generations - 1, tol=0.0, rng=np.random.default_rng(seed),
            polish=False, vectorized=True, updating="deferred",
        )
        for seed in settings.seeds
    ]  # fmt: skip
    best = min(ends, key=lambda end: end.fun)
    return bound.controller(best.x), float(best.fun)


def corner_name(corner: tuple[float, ...]) -> str:
    return "corner lambda ({:g}, {:g}), mu ({:g}, {:g})".format(*corner)


def fixed_controllers() -> dict[str, fp.AdaptiveFpid]:
    """Return the published orders, read both ways, and the 16 integer controllers."""
    named = {
        "published, by symbol": PAPER,
        "published, by sign": fp.paper_controller("sign", supervised=False),
    }
    for corner in itertools.product((1.0, 0.0), repeat=4):
        named[corner_name(corner)] = replace(
            PAPER, integral_order=corner[:2], derivative_order=corner[2:], name=""
        )
    return named


def measure(
    experiment: fp.Experiment, named: dict[str, fp.AdaptiveFpid], cost: QuadraticCost
) -> dict[str, dict[str, Any]]:
    """Return what each law comes to: with exact sensors, by RK4, under noise, supervised."""
    laws = list(named.values())
    guard = fp.paper_controller().supervisor
    clean = fp.simulate(experiment, laws)
    rk4 = fp.evaluate(replace(experiment, integrator="rk4"), laws, cost)
    noisy = fp.simulate(replace(experiment, sensors=NOISE, seed=1), laws)
    watched = fp.evaluate(experiment, [replace(law, supervisor=guard) for law in laws], cost)
    found = {}
    for name, seen, other, by_rk4, guarded in zip(named, clean, noisy, rk4, watched, strict=True):
        m, sound = seen.metrics, seen.outcome.completed and other.outcome.completed
        own = cost.of(m) if seen.outcome.completed else np.inf
        reaction = np.sqrt(np.mean((other.torque - seen.torque) ** 2)) if sound else np.inf
        found[name] = {
            "cost": own,
            "cost, RK4": by_rk4,
            "int e^2 [rad^2 s]": m.ise.sum(),
            "energy [(N m)^2 s]": m.energy.sum(),
            "variation [N m]": variation(seen),
            "peak [N m]": m.peak_torque.max(),
            "noise: cost": cost.of(other.metrics) if sound else np.inf,
            "noise: torque RMS [N m]": reaction,
            "noise: variation [N m]": variation(other) if sound else np.inf,
            "supervisor": "silent" if guarded == own else f"acts, cost {guarded:.4g}",
        }
    return found


def published(bench: Bench) -> None:
    experiment, folder = paper_experiment(bench), Path("runs/orders")
    summary: dict[str, list[str]] = {}
    details: list[tuple[str, list[str], dict[str, dict[str, Any]]]] = []
    weights = (1e-4,) if bench.quick else (0.0, 1e-4, 1e-3)
    for w2 in weights:
        cost, named, told = QuadraticCost(1.0, w2), fixed_controllers(), []
        for title, (genes, orders) in SEARCHES.items():
            slug = f"{title.replace(',', '').replace(' ', '-')}-w2-{w2:g}.npz"
            kept = {} if bench.quick else {"checkpoint": folder / slug, "resume": True}
            settings = budget(
                bench, **kept, initial=[named["tuned integer PID"]] if "from" in title else []
            )
            law = fp.paper_controller(orders, supervised=False)
            began = time.perf_counter()
            result = tune(experiment, law, Space(**genes), cost, settings)
            took = f"{result.simulations} simulated in {time.perf_counter() - began:.0f} s"
            named[title] = result.controller
            costs = ", ".join(f"{c:.5g}" for c in result.costs)
            told.append(f"- {title}: {result.cost:.5g} (seeds: {costs}), {took}: "
                f"{parameters(result.controller, genes)}")  # fmt: skip
        other = "orders by differential evolution"
        named[other], least = differential(bench, cost)
        told.append(f"- {other}: {least:.5g}: {parameters(named[other], ORDERS)}")
        found = measure(experiment, named, cost)
        rk4 = {name: row["cost, RK4"] for name, row in found.items()}
        reacts = {name: row["noise: torque RMS [N m]"] for name, row in found.items()}
        corner = min((x for x in rk4 if x.startswith("corner")), key=rk4.__getitem__)
        tuned, pid, fpid = (rk4[name] for name in list(SEARCHES)[:3])
        seed = rk4["tuned FPID, from the tuned PID"]
        told.append(f"- the best corner: {corner}")
        for name, cell in {
            "tuned orders / integer orders (1, 1)": tuned / rk4[corner_name((1, 1, 1, 1))],
            "tuned orders / published, by symbol": tuned / rk4["published, by symbol"],
            "tuned orders / published, by sign": tuned / rk4["published, by sign"],
            "tuned orders / the best of the 16 integer corners": tuned / rk4[corner],
            "FPID with tuned gains / integer PID with tuned gains": fpid / pid,
            "the same, its search started from that PID": seed / pid,
            "torque RMS from noise, that PID [N m]": reacts["tuned integer PID"],
            "torque RMS from noise, that FPID [N m]": reacts["tuned FPID"],
        }.items():
            summary.setdefault(name, []).append(f"{cell:.3f}")
        details.append((f"w2 = {w2:g}", told, found))
    spent, e = budget(bench), experiment
    bench.say(
        f"Costs by RK4, searches of {spent.population} candidates x {spent.generations} "
        f"generations, {len(spent.seeds)} seeds, {e.duration:g} s at {1e3 * e.step:g} ms: tuned "
        f"orders cost {', '.join(summary['tuned orders / published, by symbol'])} of the published "
        "ones; beside tuned gains, FPID costs "
        f"{', '.join(summary['the same, its search started from that PID'])} of the integer PID."
    )
    bench.table(["", *(f"w2 = {w2:g}" for w2 in weights)], ([k, *v] for k, v in summary.items()))
    for title, told, found in details:
        bench.details(title)
        bench.say(*told)
        heads = list(next(iter(found.values())))
        bench.table(
            ["controller", *heads],
            ([name, *(x if isinstance(x, str) else f"{x:.4g}" for x in row.values())]
             for name, row in found.items()),
        )  # fmt: skip


if __name__ == "__main__":
    run(__doc__, published)
