"""Orders that adapt: against the best fixed ones, under noise, on arms, for long, and where not.

    python benchmarks/adaptive_orders.py [--quick] [--workers N] [PART ...]

Parts: paper, noise, arms, long, fast; all if none is given. The cost is (33) with w2 = 1e-4, as in
`orders.py`. Writes benchmarks/results/adaptive_orders.md and adaptive_orders.png.
"""

from __future__ import annotations

import argparse
import dataclasses
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from common import ORDERS, RESULTS, Report, arm_of, around_home, parameters, table, tail, variation
from cross_check import cross_check

import fpid_pin as fp
from fpid_pin.control import adapt_orders
from fpid_pin.costs import QuadraticCost
from fpid_pin.references import Hold
from fpid_pin.tuning import SearchSettings, Space, tune

COST = QuadraticCost(1.0, 1e-4)
TWO_LINK = fp.Arm.two_link()
PAPER = fp.paper_controller(supervised=False)
STARTS: dict[str, tuple[float, float] | None] = {
    "published, (0.90, 0.93), (0.92, 0.93)": None,
    "integer, 1, 1": (1.0, 1.0),
    "0.5, 0.7": (0.5, 0.7),
    "0.1, 0.4": (0.1, 0.4),
    "no integral, 0.02, 1": (0.02, 1.0),
    "little damping, 1, 0.3": (1.0, 0.3),
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


def starting(law: fp.AdaptiveFpid, orders: tuple[float, float] | None) -> fp.AdaptiveFpid:
    """Return a law with other orders, lambda and mu; None: with its own."""
    if orders is None:
        return law
    return dataclasses.replace(law, integral_order=orders[0], derivative_order=orders[1])


def moving(law: fp.AdaptiveFpid, rate: Any) -> fp.AdaptiveFpid:
    """Return a law with orders that move within their widest bounds."""
    return dataclasses.replace(law, order_learning_rate=rate)


def unbounded(law: fp.AdaptiveFpid, arm: fp.Arm) -> fp.AdaptiveFpid:
    """Return a law with the rates of `adapt_orders` and the widest bounds."""
    return moving(law, adapt_orders(law, arm).order_learning_rate)


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
        law = starting(PAPER, start)
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


def best_fixed(options: argparse.Namespace) -> Iterator[str]:
    """Search for the best orders that stay: the genetic algorithm, and differential evolution."""
    experiment = fp.paper_experiment(duration=options.duration)
    settings = SearchSettings(
        population=options.population, generations=options.generations, seeds=options.seeds,
        workers=options.workers,
    )  # fmt: skip
    found = tune(experiment, PAPER, Space(**ORDERS), COST, settings)
    law, cost, _ = cross_check(experiment, PAPER, Space(**ORDERS), COST, settings)
    line = f"Genetic algorithm, {options.population} x {options.generations}, seeds: "
    line += f"{', '.join(f'{c:.4f}' for c in found.costs)}; differential evolution: {cost:.4f}."
    if found.cost <= cost:
        law, cost = found.controller, found.cost
    options.law, options.cost = law, cost
    yield f"Best fixed orders: {cost:.4f}, {parameters(law, ORDERS)}. {line}\n"


def paper(options: argparse.Namespace) -> Iterator[str]:
    """Yield costs on the paper's experiment by start and rate, and by the gains' own rate."""
    experiment = fp.paper_experiment(duration=options.duration)
    yield "## The paper's experiment\n"
    laws = [
        law
        for start in STARTS.values()
        for law in (
            *(moving(starting(PAPER, start), rate) for rate in RATES),
            unbounded(starting(PAPER, start), TWO_LINK),
            adapt_orders(starting(PAPER, start), TWO_LINK),
        )
    ]
    costs = fp.evaluate(experiment, laws, COST).reshape(len(STARTS), -1)
    heads = ["lambda, mu at the start", *(f"{rate:g}" for rate in RATES), "rule", "adapt_orders"]
    rows = [[name, *(f"{c:.3f}" for c in row)] for name, row in zip(STARTS, costs, strict=True)]
    rows.append(["within 3 % of the best fixed", *(costs <= 1.03 * options.cost).sum(axis=0)])
    rows.append(["below the best fixed", *(costs < options.cost).sum(axis=0)])
    yield from table(heads, rows)
    yield "Faster gains instead, gamma of Kp, Ki and Kd, published orders; largest Kp, Ki, Kd:\n"
    rows = []
    for gamma in (25.0, 50.0, 100.0, 250.0):
        law = dataclasses.replace(PAPER, learning_rate=gamma)
        runs = fp.simulate(experiment, [law, unbounded(law, TWO_LINK)])
        cells = []
        for run in runs:
            most = ", ".join(f"{getattr(run, gain).max():.0f}" for gain in ("kp", "ki", "kd"))
            cells.append(f"{COST.of(run.metrics):.3f}; {most}")
        rows.append([f"{gamma:g}", *cells])
    yield from table(["gamma", "fixed orders", "orders that move, rule"], rows)
    if not options.quick:
        draw(RESULTS / "adaptive_orders.png", experiment)


def noise(options: argparse.Namespace) -> Iterator[str]:
    """Yield medians over seeds on the paper's experiment under imperfect measurements."""
    yield "## The same under noise\n"
    base = fp.paper_experiment(duration=options.duration)
    candidates = {
        "published, fixed": PAPER,
        "best fixed": options.law,
        "published, rate 0.1": moving(PAPER, 0.1),
        "published, rule": unbounded(PAPER, TWO_LINK),
        "published, adapt_orders": adapt_orders(PAPER, TWO_LINK),
        "integer, adapt_orders": adapt_orders(starting(PAPER, (1.0, 1.0)), TWO_LINK),
        "0.5, 0.7, adapt_orders": adapt_orders(starting(PAPER, (0.5, 0.7)), TWO_LINK),
    }
    for kind, sensors in SENSORS.items():
        yield f"{kind}; medians of {len(options.noise_seeds)} seeds:\n"
        guards = GUARDS if sensors is SENSORS["white, 0.05 rad/s"] else {"none": None}
        rows = []
        for guard, safeguards in guards.items():
            for name, law in candidates.items():
                law = dataclasses.replace(law, safeguards=safeguards)
                noisy = [dataclasses.replace(base, sensors=sensors, seed=s)
                         for s in options.noise_seeds]  # fmt: skip
                runs = fp.simulate(noisy, law)
                cost, rms, moved = np.median(
                    [[COST.of(r.metrics), tail(r), variation(r)] for r in runs], axis=0
                )
                end = runs[0].signals.get("derivative_order")
                mu = "" if end is None else f"{end[len(end) // 2 :].mean():.2f}"
                rows.append([guard, name, f"{cost:.3f}", f"{rms:.1f}", f"{moved:.0f}", mu])
        heads = ["safeguard", "orders", "cost", "tail RMS [mrad]", "variation [N m]"]
        yield from table([*heads, "mean late mu"], rows, 2)


def arms(options: argparse.Namespace) -> Iterator[str]:
    """Yield how arms with suggested gains do with and without."""
    yield "## Arms with suggested gains\n"
    yield "RMS of the worst joint over the last half [mrad] / variation of the torques [N m]:\n"
    rows = []
    for name in ("two_link", "ur5", "panda"):
        arm = arm_of(name)
        law = fp.suggest_gains(arm)
        low = starting(law, (0.5, 0.7))
        faster = dataclasses.replace(law, learning_rate=10.0 * np.asarray(law.learning_rate))
        laws = [
            law, adapt_orders(law, arm), adapt_orders(law, arm, speed=10.0), unbounded(law, arm),
            faster, low, adapt_orders(low, arm),
        ]  # fmt: skip
        for job, experiment in jobs(arm, options.duration).items():
            runs = fp.simulate(experiment, laws)
            cells = [f"{worst(run)} / {variation(run):.0f}" for run in runs]
            rows.append([name, job, *cells])
    heads = [
        "arm", "job", "fixed", "adapt_orders", "speed 10", "rule, lambda, mu up to 1",
        "fixed, gains 10 x as fast", "(0.5, 0.7), fixed", "(0.5, 0.7), adapt_orders",
    ]  # fmt: skip
    yield from table(heads, rows, 2)
    yield "UR5, 0.3 rad at 1 rad/s, from other orders; RMS of the worst joint [mrad]:\n"
    arm = fp.Arm.from_example("ur5")
    experiment = jobs(arm, options.duration)["0.3 rad at 1 rad/s"]
    rows = []
    for name, start in list(STARTS.items())[1:]:
        law = starting(fp.suggest_gains(arm), start)
        laws = [law, adapt_orders(law, arm), unbounded(law, arm)]
        rows.append([name, *(worst(run) for run in fp.simulate(experiment, laws))])
    yield from table(["lambda, mu", "fixed", "adapt_orders", "rule, lambda, mu up to 1"], rows)


def worst(run: fp.Run) -> str:
    """Return the RMS of the worst joint over the last half [mrad], or where the run ended."""
    if not run.outcome.completed:
        return f"ended at {run.outcome.time:.1f} s"
    return f"{1e3 * run.metrics.rms_tail.max():.2f}"


def long(options: argparse.Namespace) -> Iterator[str]:
    """Yield what five minutes do to errors and orders."""
    yield "## Five minutes\n"
    minute = 4.0 if options.quick else 60.0
    track = dataclasses.replace(
        fp.paper_experiment(duration=5.0 * minute), sensors=SENSORS["white, 0.05 rad/s"], seed=1
    )
    hold = dataclasses.replace(track, reference=Hold((0.5, 0.5)), v0=(0.0, 0.0))
    suggested = fp.suggest_gains(TWO_LINK)
    laws = {
        "paper's gains, fixed": PAPER,
        "paper's gains, rule": unbounded(PAPER, TWO_LINK),
        "paper's gains, adapt_orders": adapt_orders(PAPER, TWO_LINK),
        "paper's gains, adapt_orders, leakage": adapt_orders(
            dataclasses.replace(PAPER, safeguards=GUARDS["leakage 0.03 1/s"]), TWO_LINK
        ),
        "paper's gains, mu only": moving(
            PAPER, adapt_orders(PAPER, TWO_LINK).order_learning_rate * [[0.0], [1.0]]
        ),
        "suggested gains, fixed": suggested,
        "suggested gains, adapt_orders": adapt_orders(suggested, TWO_LINK),
    }
    rows = []
    for job, experiment in {"tracking": track, "holding": hold}.items():
        for name, law in laws.items():
            run = fp.simulate(experiment, law)
            if not run.outcome.completed:
                rows.append([job, name, str(run.outcome)])
                continue
            parts = np.array_split(np.arange(len(run.t)), 5)
            rms = [1e3 * float(np.sqrt((run.error[p] ** 2).mean())) for p in parts]
            moved = [float(np.abs(np.diff(run.torque[p], axis=0)).sum()) for p in parts]
            cells = [f"{rms[1]:.2f}", f"{rms[4]:.2f}", f"{moved[1]:.0f}", f"{moved[4]:.0f}"]
            for order in ("integral_order", "derivative_order"):
                fifth = run.signals[order][parts[4]].T if order in run.signals else []
                cells.append("; ".join(f"{x.min():.2f} to {x.max():.2f}" for x in fifth))
            rows.append([job, name, *cells])
    yield "RMS [mrad], variation [N m] of the second and fifth minute; orders in the fifth:\n"
    heads = ["job", "law", "RMS, 2nd", "5th", "variation, 2nd", "5th", "lambda", "mu"]
    yield from table(heads, rows, 2)


def fast(options: argparse.Namespace) -> Iterator[str]:
    """Yield what rates that are too high do."""
    yield "## Rates that are too high\n"
    speeds = (1.0, 3.0, 10.0, 30.0, 100.0, 1000.0)
    laws = [adapt_orders(PAPER, TWO_LINK, speed=speed) for speed in speeds]
    runs = fp.simulate(fp.paper_experiment(duration=options.duration), laws)
    rows = [
        [f"{speed:g}", f"{COST.of(run.metrics):.3f}", f"{tail(run):.1f}", f"{variation(run):.0f}",
         f"{run.metrics.peak_torque.max():.1f}"]
        for speed, run in zip(speeds, runs, strict=True)
    ]  # fmt: skip
    yield from table(["speed", "cost", "tail RMS [mrad]", "variation [N m]", "peak [N m]"], rows)


def main() -> None:
    """Run what is asked for; print it, and write it if it is everything."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parts = {"paper": paper, "noise": noise, "arms": arms, "long": long, "fast": fast}
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(parts)}; all if none")
    parser.add_argument("--quick", action="store_true", help="a look only; nothing written")
    parser.add_argument("--workers", type=int, default=None)
    options = parser.parse_args()
    asked = options.parts or list(parts)
    options.population, options.generations, options.seeds = 40, 50, [0, 1]
    options.noise_seeds, options.duration = [1, 2, 3, 4, 5], 20.0
    if options.quick:
        options.population, options.generations, options.seeds = 12, 3, [0]
        options.noise_seeds, options.duration = [1], 4.0
    warnings.simplefilter("ignore", fp.FpidWarning)
    report = Report()
    if {"paper", "noise"} & set(asked):
        report.add(*best_fixed(options))
    for part in asked:
        for line in parts[part](options):
            report.add(line)
    if set(asked) == set(parts) and not options.quick:
        report.write("adaptive_orders.md", "# Orders that adapt")


if __name__ == "__main__":
    main()
