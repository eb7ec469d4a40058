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

import numpy as np
from cross_check import cross_check
from order_cases import (
    COST,
    GUARDS,
    PAPER,
    RATES,
    SENSORS,
    STARTS,
    TWO_LINK,
    draw,
    jobs,
    moving,
    table,
    tail,
    unbounded,
    variation,
)

import fpid_pin as fp
from fpid_pin.control import adapt_orders
from fpid_pin.references import Hold
from fpid_pin.tuning import SearchSettings, Space, tune


def best_fixed(options: argparse.Namespace) -> tuple[fp.AdaptiveFpid, float, list[str]]:
    """Search for the best orders that stay: the genetic algorithm, and differential evolution."""
    experiment = fp.paper_experiment(duration=options.duration)
    settings = SearchSettings(
        population=options.population, generations=options.generations, seeds=options.seeds,
        workers=options.workers,
    )  # fmt: skip
    space = Space(integral_order=(0, 1), derivative_order=(0, 1))
    found = tune(experiment, PAPER, space, COST, settings)
    law, other, _ = cross_check(experiment, PAPER, space, COST, settings)
    best, cost = (found.controller, found.cost) if found.cost <= other else (law, other)
    orders = ", ".join(
        f"{name} ({', '.join(f'{x:.3f}' for x in np.atleast_1d(getattr(best, name)))})"
        for name in ("integral_order", "derivative_order")
    )
    line = (
        f"Best fixed orders: {cost:.4f}, {orders}. Genetic algorithm, {options.population} x "
        f"{options.generations}, seeds: {', '.join(f'{c:.4f}' for c in found.costs)}; "
        f"differential evolution: {other:.4f}."
    )
    return best, cost, [line, ""]


def paper(best: float, options: argparse.Namespace) -> Iterator[str]:
    """Yield costs on the paper's experiment by start and rate, and by the gains' own rate."""
    experiment = fp.paper_experiment(duration=options.duration)
    yield "## The paper's experiment\n"
    laws = [
        law
        for start in STARTS.values()
        for law in (
            *(moving(PAPER, rate, **start) for rate in RATES),
            unbounded(dataclasses.replace(PAPER, **start), TWO_LINK),
            adapt_orders(dataclasses.replace(PAPER, **start), TWO_LINK),
        )
    ]
    costs = fp.evaluate(experiment, laws, COST).reshape(len(STARTS), -1)
    heads = ["lambda, mu at the start", *(f"{rate:g}" for rate in RATES), "rule", "adapt_orders"]
    rows = [[name, *(f"{c:.3f}" for c in row)] for name, row in zip(STARTS, costs, strict=True)]
    rows.append(
        ["within 3 % of the best fixed", *(f"{n}" for n in (costs <= 1.03 * best).sum(axis=0))]
    )
    rows.append(["below the best fixed", *(f"{n}" for n in (costs < best).sum(axis=0))])
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
        draw(options.out.with_suffix(".png"), experiment)


def noise(best: fp.AdaptiveFpid, options: argparse.Namespace) -> Iterator[str]:
    """Yield medians over seeds on the paper's experiment under imperfect measurements."""
    yield "## The same under noise\n"
    base = fp.paper_experiment(duration=options.duration)
    candidates = {
        "published, fixed": PAPER,
        "best fixed": best,
        "published, rate 0.1": moving(PAPER, 0.1),
        "published, rule": unbounded(PAPER, TWO_LINK),
        "published, adapt_orders": adapt_orders(PAPER, TWO_LINK),
        "integer, adapt_orders": adapt_orders(
            dataclasses.replace(PAPER, **STARTS["integer, 1, 1"]), TWO_LINK
        ),
        "0.5, 0.7, adapt_orders": adapt_orders(
            dataclasses.replace(PAPER, **STARTS["0.5, 0.7"]), TWO_LINK
        ),
    }
    for kind, sensors in SENSORS.items():
        yield f"{kind}; medians of {len(options.noise_seeds)} seeds:\n"
        guards = GUARDS if sensors is SENSORS["white, 0.05 rad/s"] else {"none": None}
        rows = []
        for guard, safeguards in guards.items():
            for name, law in candidates.items():
                law = dataclasses.replace(law, safeguards=safeguards)
                runs = fp.simulate(
                    [
                        dataclasses.replace(base, sensors=sensors, seed=s)
                        for s in options.noise_seeds
                    ],
                    law,
                )
                cost, rms, moved = np.median(
                    [[COST.of(r.metrics), tail(r), variation(r)] for r in runs], axis=0
                )
                end = runs[0].signals.get("derivative_order")
                mu = "" if end is None else f"{end[len(end) // 2 :].mean():.2f}"
                rows.append([guard, name, f"{cost:.3f}", f"{rms:.1f}", f"{moved:.0f}", mu])
        heads = [
            "safeguard",
            "orders",
            "cost",
            "tail RMS [mrad]",
            "variation [N m]",
            "mean late mu",
        ]
        yield from table(heads, rows, 2)


def arms(options: argparse.Namespace) -> Iterator[str]:
    """Yield how arms with suggested gains do with and without."""
    yield "## Arms with suggested gains\n"
    yield "RMS of the worst joint over the last half [mrad] / variation of the torques [N m]:\n"
    rows = []
    for name in ("two_link", "ur5", "panda"):
        arm = TWO_LINK if name == "two_link" else fp.Arm.from_example(name)
        law = fp.suggest_gains(arm)
        low = dataclasses.replace(law, integral_order=0.5, derivative_order=0.7)
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
        law = dataclasses.replace(fp.suggest_gains(arm), **start)
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
                seen = run.signals.get(order)
                cells.append(
                    "" if seen is None else "; ".join(
                        f"{a:.2f} to {b:.2f}"
                        for a, b in zip(seen[parts[4]].min(axis=0), seen[parts[4]].max(axis=0),
                                        strict=True)
                    )
                )  # fmt: skip
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
    parts = ("paper", "noise", "arms", "long", "fast")
    parser.add_argument("parts", nargs="*", metavar="PART", help=f"{', '.join(parts)}; all if none")
    parser.add_argument("--quick", action="store_true", help="a look only; nothing written")
    parser.add_argument("--workers", type=int, default=None)
    parser.add_argument("--population", type=int, default=40)
    parser.add_argument("--generations", type=int, default=50)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1])
    parser.add_argument("--noise-seeds", type=int, nargs="+", default=[1, 2, 3, 4, 5])
    parser.add_argument(
        "--out", type=Path, default=Path(__file__).parent / "results" / "adaptive_orders.md"
    )
    options = parser.parse_args()
    asked = options.parts or list(parts)
    options.duration = 20.0
    if options.quick:
        options.population, options.generations, options.seeds = 12, 3, [0]
        options.noise_seeds, options.duration = [1], 4.0
    warnings.simplefilter("ignore", fp.FpidWarning)
    lines: list[str] = ["# Orders that adapt", ""]

    def tell(more: Iterator[str] | list[str]) -> None:
        for line in more:
            lines.append(line)
            print(line, flush=True)

    if {"paper", "noise"} & set(asked):
        law, cost, found = best_fixed(options)
        tell(found)
    for part in asked:
        if part == "paper":
            tell(paper(cost, options))
        elif part == "noise":
            tell(noise(law, options))
        else:
            tell({"arms": arms, "long": long, "fast": fast}[part](options))
    if set(asked) == set(parts) and not options.quick:
        options.out.write_text("\n".join(lines).rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
