"""Do orders that adapt beat the best that stay?

paper: the cost (33) with w2 = 1e-4 on the paper's experiment, by start and rate of the orders;
noise: the same under noise and delay; arms: on arms with suggested gains; long: for five minutes.
"""

import itertools
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
from common import Bench, arm_of, around_home, panels, parameters, run, tail, variation
from orders import NOISE, ORDERS, PAPER, budget, differential, paper_experiment

import fpid_pin as fp
from fpid_pin.control import adapt_orders
from fpid_pin.costs import QuadraticCost
from fpid_pin.references import Hold
from fpid_pin.tuning import Space, tune

COST = QuadraticCost(1.0, 1e-4)
TWO_LINK = fp.Arm.two_link()
STARTS: dict[str, tuple[Any, Any]] = {
    "published, (0.90, 0.93), (0.92, 0.93)": (PAPER.integral_order, PAPER.derivative_order),
    "integer, 1, 1": (1.0, 1.0),
    "0.5, 0.7": (0.5, 0.7),
    "0.1, 0.4": (0.1, 0.4),
    "no integral, 0.02, 1": (0.02, 1.0),
    "little damping, 1, 0.3": (1.0, 0.3),
}
GUARDS = {
    "none": None,
    "dead zone 0.1": fp.Safeguards(dead_zone=0.1),
    "leakage 0.03 1/s": fp.Safeguards(sigma=0.03),
}
SENSORS = {
    "white, 0.05 rad/s": NOISE,
    "differentiated from angles with 0.1 mrad": fp.Sensors(
        position_noise=1e-4, velocity="differentiated"
    ),
    "white, 0.05 rad/s, 2 ms late": fp.Sensors(velocity_noise=0.05, delay=2),
}


def starting(law: fp.AdaptiveFpid, orders: tuple[Any, Any]) -> fp.AdaptiveFpid:
    """Return a law with other orders, lambda and mu."""
    return replace(law, integral_order=orders[0], derivative_order=orders[1])


def moving(law: fp.AdaptiveFpid, rate: Any) -> fp.AdaptiveFpid:
    """Return a law with orders that move within their widest bounds."""
    return replace(law, order_learning_rate=rate)


def unbounded(law: fp.AdaptiveFpid, arm: fp.Arm) -> fp.AdaptiveFpid:
    """Return a law with the rates of `adapt_orders` and the widest bounds."""
    return moving(law, adapt_orders(law, arm).order_learning_rate)


@cache
def best_fixed(bench: Bench) -> tuple[fp.Controller, float]:
    """Search, once, for the best orders that stay: the genetic algorithm, and another."""
    found = tune(paper_experiment(bench), PAPER, Space(**ORDERS), COST, budget(bench))
    other = differential(bench, COST)
    best, least = min((found.controller, found.cost), other, key=lambda pair: pair[1])
    costs = ", ".join(f"{c:.4f}" for c in found.costs)
    bench.say(
        f"The best fixed orders cost {least:.4f}, {parameters(best, ORDERS)} "
        f"(genetic algorithm, seeds: {costs}; differential evolution: {other[1]:.4f})."
    )
    return best, least


def paper(bench: Bench) -> None:
    experiment, (_, least) = paper_experiment(bench), best_fixed(bench)
    rates = (0.0, 0.01, 0.1, 0.3, 1.0, 3.0)
    laws = [
        law
        for start in (starting(PAPER, orders) for orders in STARTS.values())
        for law in (*(moving(start, rate) for rate in rates), unbounded(start, TWO_LINK),
                    adapt_orders(start, TWO_LINK))
    ]  # fmt: skip
    costs = fp.evaluate(experiment, laws, COST).reshape(len(STARTS), -1)
    heads = ["lambda, mu at the start", *(f"{rate:g}" for rate in rates), "rule", "adapt_orders"]
    below = (costs < least).sum(axis=0)
    bench.say(
        f"At the rate 0.1 orders that adapt end below the best fixed ones from {below[2]} of "
        f"{len(STARTS)} starts, at 0.3 from {below[3]}, by `adapt_orders` from {below[-1]}."
    )
    rows = [[name, *(f"{c:.3f}" for c in row)] for name, row in zip(STARTS, costs, strict=True)]
    rows.append(["within 3 % of the best fixed", *(costs <= 1.03 * least).sum(axis=0)])
    rows.append(["below the best fixed", *below])
    bench.table(heads, rows)
    bench.figure(drawn(experiment), "adaptive_orders.png", "Orders over time from six starts")
    bench.details("Faster gains instead")
    rows = []
    for gamma in (25.0, 50.0, 100.0, 250.0):
        law = replace(PAPER, learning_rate=gamma)
        cells = []
        for seen in fp.simulate(experiment, [law, unbounded(law, TWO_LINK)]):
            most = ", ".join(f"{getattr(seen, gain).max():.0f}" for gain in ("kp", "ki", "kd"))
            cells.append(f"{COST.of(seen.metrics):.3f}; {most}")
        rows.append([f"{gamma:g}", *cells])
    bench.say("Published orders; cost; largest Kp, Ki, Kd:")
    bench.table(["gamma", "fixed orders", "orders that move, rule"], rows)


def drawn(experiment: fp.Experiment) -> Any:
    """Draw the orders over time, from every start, at a slow rate and by the rule."""
    figure, axes = panels((11, 8), 4, 2, sharex=True, sharey=True)
    for k, (name, orders) in enumerate(STARTS.items()):
        law = starting(PAPER, orders)
        for column, moved in enumerate((moving(law, 0.1), unbounded(law, TWO_LINK))):
            seen = fp.simulate(experiment, moved)
            for row, (order, joint) in enumerate(itertools.product(ORDERS, (0, 1))):
                path = seen.signals[order][::20, joint]
                axes[row, column].plot(seen.t[::20], path, color=f"C{k}", label=name, lw=1.0)
                symbol = r"\lambda" if order.startswith("i") else r"\mu"
                axes[row, 0].set_ylabel(f"${symbol}_{joint + 1}$")
    for panel, title in zip(axes[0], ("rate 0.1", "rates by the rule"), strict=True):
        panel.set_title(title)
    for panel in axes[-1]:
        panel.set_xlabel("time [s]")
    figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def noise(bench: Bench) -> None:
    bench.details("Under noise")
    base, (best, _) = paper_experiment(bench), best_fixed(bench)
    seeds = range(1, 2 if bench.quick else 6)
    candidates: dict[str, Any] = {
        "published, fixed": PAPER,
        "best fixed": best,
        "published, rate 0.1": moving(PAPER, 0.1),
        "published, rule": unbounded(PAPER, TWO_LINK),
        "published, adapt_orders": adapt_orders(PAPER, TWO_LINK),
        "integer, adapt_orders": adapt_orders(starting(PAPER, (1.0, 1.0)), TWO_LINK),
        "0.5, 0.7, adapt_orders": adapt_orders(starting(PAPER, (0.5, 0.7)), TWO_LINK),
    }
    rows = []
    for kind, sensors in SENSORS.items():
        guards = GUARDS if sensors is NOISE else {"none": None}
        for (guard, safeguards), (name, law) in itertools.product(
            guards.items(), candidates.items()
        ):
            noisy = [replace(base, sensors=sensors, seed=seed) for seed in seeds]
            runs = fp.simulate(noisy, replace(law, safeguards=safeguards))
            figures = [[COST.of(seen.metrics), tail(seen), variation(seen)] for seen in runs]
            cost, rms, moved = np.median(figures, axis=0)
            end = runs[0].signals.get("derivative_order")
            mu = "" if end is None else f"{end[len(end) // 2 :].mean():.2f}"
            rows.append([kind, guard, name, f"{cost:.3f}", f"{rms:.1f}", f"{moved:.0f}", mu])
    heads = ["noise", "safeguard", "orders", "cost", "tail RMS [mrad]", "variation [N m]"]
    bench.say(f"Medians of {len(seeds)} seeds:")
    bench.table([*heads, "mean late mu"], rows, 3)


def worst(seen: fp.Run) -> str:
    """Return the RMS of the worst joint over the last half [mrad], or where the run ended."""
    if not seen.outcome.completed:
        return f"ended at {seen.outcome.time:.1f} s"
    return f"{1e3 * seen.metrics.rms_tail.max():.2f}"


def arms(bench: Bench) -> None:
    bench.details("Arms with suggested gains")
    rows, others, duration = [], [], 2.0 if bench.quick else 20.0
    for name in ("two_link", "ur5", "panda"):
        arm = arm_of(name)
        law = fp.suggest_gains(arm)
        low = starting(law, (0.5, 0.7))
        faster = replace(law, learning_rate=10.0 * np.asarray(law.learning_rate))
        laws = [
            law, adapt_orders(law, arm), adapt_orders(law, arm, speed=10.0), unbounded(law, arm),
            faster, low, adapt_orders(low, arm),
        ]  # fmt: skip
        base = fp.Experiment(arm, around_home(arm), duration=duration, dynamics="compiled")
        for job, changed in {
            "0.3 rad at 1 rad/s": {},
            "with 3 kg": {"plant": fp.Plant(arm=arm.with_payload(3.0))},
            "at 2 rad/s": {"reference": around_home(arm, 0.3, 2.0)},
            "noise 0.05 rad/s": {"sensors": NOISE, "seed": 1},
            "hold a pose": {"reference": Hold(arm.home + 0.3), "q0": arm.home},
        }.items():
            runs = fp.simulate(replace(base, **changed), laws)
            rows.append([name, job, *(f"{worst(x)} / {variation(x):.0f}" for x in runs)])
        if name == "ur5":
            for told, orders in list(STARTS.items())[1:]:
                start = starting(law, orders)
                laws = [start, adapt_orders(start, arm), unbounded(start, arm)]
                others.append([told, *map(worst, fp.simulate(base, laws))])
    heads = [
        "arm", "job", "fixed", "adapt_orders", "speed 10", "rule, lambda, mu up to 1",
        "fixed, gains 10 x as fast", "(0.5, 0.7), fixed", "(0.5, 0.7), adapt_orders",
    ]  # fmt: skip
    bench.say("RMS of the worst joint, last half [mrad] / variation of the torques [N m]:")
    bench.table(heads, rows, 2)
    bench.say("UR5, 0.3 rad at 1 rad/s, from other orders; RMS of the worst joint [mrad]:")
    bench.table(["lambda, mu", "fixed", "adapt_orders", "rule, lambda, mu up to 1"], others)


def long(bench: Bench) -> None:
    bench.details("Five minutes")
    minute = 2.0 if bench.quick else 60.0
    track = replace(fp.paper_experiment(duration=5.0 * minute), sensors=NOISE, seed=1)
    track = track.with_dynamics("compiled")
    hold = replace(track, reference=Hold((0.5, 0.5)), v0=(0.0, 0.0))
    suggested, adapting = fp.suggest_gains(TWO_LINK), adapt_orders(PAPER, TWO_LINK)
    laws = {
        "paper's gains, fixed": PAPER,
        "paper's gains, rule": unbounded(PAPER, TWO_LINK),
        "paper's gains, adapt_orders": adapting,
        "paper's gains, adapt_orders, leakage": replace(
            adapting, safeguards=GUARDS["leakage 0.03 1/s"]
        ),
        "paper's gains, mu only": moving(PAPER, adapting.order_learning_rate * [[0.0], [1.0]]),
        "suggested gains, fixed": suggested,
        "suggested gains, adapt_orders": adapt_orders(suggested, TWO_LINK),
    }
    rows = []
    for (job, experiment), (name, law) in itertools.product(
        {"tracking": track, "holding": hold}.items(), laws.items()
    ):
        seen = fp.simulate(experiment, law)
        if not seen.outcome.completed:
            rows.append([job, name, str(seen.outcome)])
            continue
        parts = np.array_split(np.arange(len(seen.t)), 5)
        rms = [1e3 * float(np.sqrt((seen.error[p] ** 2).mean())) for p in parts]
        moved = [float(np.abs(np.diff(seen.torque[p], axis=0)).sum()) for p in parts]
        cells = [f"{rms[1]:.2f}", f"{rms[4]:.2f}", f"{moved[1]:.0f}", f"{moved[4]:.0f}"]
        for order in ORDERS:
            fifth = seen.signals[order][parts[4]].T if order in seen.signals else []
            cells.append("; ".join(f"{x.min():.2f} to {x.max():.2f}" for x in fifth))
        rows.append([job, name, *cells])
    bench.say("RMS [mrad], variation [N m] of the second and fifth minute; orders in the fifth:")
    heads = ["job", "law", "RMS, 2nd", "5th", "variation, 2nd", "5th", "lambda", "mu"]
    bench.table(heads, rows, 2)


if __name__ == "__main__":
    run(__doc__, paper, noise, arms, long)
