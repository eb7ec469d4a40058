"""Time the lockstep engine beside the loop that a user of Pinocchio would write.

    python benchmarks/speed.py [--steps 2000] [--repeats 5] [--joints] [--dynamics compiled]
    python benchmarks/speed.py --search 80 [--workers 2] [--dynamics compiled]

Both run the paper's experiment with the same law and the same 24 modes, in turn in this process;
what counts is their ratio, since machines differ and are shared. Times are of the processor, in one
thread; others on the machine lengthen the clock's, not these. Also: the part of the time that
is the dynamics', the import time, and (--joints) the cost of a step against the number of joints.
"""

from __future__ import annotations

import argparse
import dataclasses
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pinocchio as pin
from plain_loop import plain_loop

import fpid_pin as fp
from fpid_pin.arms import Fleet
from fpid_pin.arms.bodies import CompiledFleet
from fpid_pin.costs import QuadraticCost
from fpid_pin.references import Sinusoid
from fpid_pin.tuning import SearchProgress, SearchSettings, Space, WorkerPool

RUNS = (1, 10, 30, 60, 120, 240)


def best(action: Callable[[], object], repeats: int) -> float:
    """Return the shortest of several times [s]: what is needed when nobody else is there."""
    times = []
    for _ in range(repeats):
        began = time.process_time()
        action()
        times.append(time.process_time() - began)
    return min(times)


def population(runs: int, seed: int = 0) -> list[fp.AdaptiveFpid]:
    """Return controllers with different orders, as a genetic algorithm would ask for."""
    rng = np.random.default_rng(seed)
    base = fp.paper_controller(supervised=False)
    return [
        dataclasses.replace(
            base, integral_order=rng.uniform(0.5, 1, 2), derivative_order=rng.uniform(0.5, 1, 2)
        )
        for _ in range(runs)
    ]


def dynamics_ns(kind: str, runs: int, repeats: int) -> float:
    """Ns a run of one forward dynamics call for `runs` robots."""
    arm = fp.Arm.two_link()
    fleet = (
        CompiledFleet([arm] * runs, np.zeros((runs, 2)))
        if kind == "compiled"
        else Fleet([arm], runs)
    )
    rng = np.random.default_rng(0)
    q, v, tau = rng.normal(size=(3, runs, 2))
    out = np.empty((runs, 2))
    calls = 500

    def many() -> None:
        for _ in range(calls):
            fleet.forward_dynamics(q, v, tau, out)

    return 1e9 * best(many, repeats) / calls / runs


def aba_ns(repeats: int) -> float:
    """Ns of one pin.aba call on the two-link arm: the unit of this machine."""
    model = fp.Arm.two_link().model
    data = model.createData()
    q, v, tau = np.zeros((3, 2))

    def many() -> None:
        for _ in range(2000):
            pin.aba(model, data, q, v, tau)

    return 1e9 * best(many, repeats) / 2000


def headline(steps: int, repeats: int, dynamics: str) -> None:
    controller = fp.paper_controller(supervised=False)
    experiment = dataclasses.replace(fp.paper_experiment(duration=steps * 1e-3), dynamics=dynamics)
    rows = experiment.rows
    check = plain_loop(experiment, controller, rows)
    apart = np.abs(check - fp.simulate(experiment, controller).q).max()
    unit = aba_ns(repeats)
    print(f"the two loops agree within {apart:.1e} rad; one pin.aba call takes {unit:.0f} ns here")
    print()
    print("| runs | ns a run-step | plain / ours | in the dynamics | pin.aba calls |")
    print("| ---: | ---: | ---: | ---: | ---: |")
    for runs in RUNS:
        controllers = population(runs)
        pairs = []
        for _ in range(repeats):
            began = time.process_time()
            plain_loop(experiment, controller, rows)
            middle = time.process_time()
            fp.evaluate(experiment, controllers)
            end = time.process_time()
            pairs.append(((middle - began) / steps, (end - middle) / steps / runs))
        ratio = float(np.median([plain / ours for plain, ours in pairs]))
        ours = 1e9 * min(ours for _, ours in pairs)
        part = dynamics_ns(dynamics, runs, repeats) / ours
        print(f"| {runs} | {ours:.0f} | {ratio:.1f} | {100 * part:.0f} % | {ours / unit:.2f} |")
    plain = 1e9 * best(lambda: plain_loop(experiment, controller, rows), repeats) / steps
    print(f"| plain loop, 1 | {plain:.0f} | 1 | | {plain / unit:.2f} |")


def importing(repeats: int) -> None:
    code = (
        "import time; t = time.process_time(); import fpid_pin; fpid_pin.tune; "
        "print(time.process_time() - t)"
    )
    times = [
        float(subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout)
        for _ in range(repeats)
    ]
    best, middle = min(times), np.median(times)
    print(f"\nimport fpid_pin, all but views: {best:.2f} s at best, {middle:.2f} s median")


def joints(repeats: int, runs: int = 60) -> None:
    """Print and draw the cost of a step against the number of joints; start-up is left out."""
    counts = (2, 5, 10, 20, 30, 40, 50)
    found = []
    print(f"\n| joints | us a run-step at {runs} runs | us a joint | one pin.aba [us] |")
    print("| ---: | ---: | ---: | ---: |")
    for n in counts:
        arm = fp.Arm.planar(np.full(n, 1.0 / n), np.full(n, 2.0 / n), gravity=0.0)
        # The derivative gain is small: many light links allow little in a loop of 1 ms.
        law = fp.AdaptiveFpid(
            kp=1e-2, ki=1e-2, kd=1e-3, integral_order=0.9, derivative_order=0.9,
            learning_rate=1e-6, scale="inertia",
        )  # fmt: skip
        seconds = []
        for steps in (200, 700):
            experiment = fp.Experiment(arm, Sinusoid(0.01, 1.0, np.zeros(n)), duration=steps * 1e-3)
            assert np.isfinite(fp.evaluate(experiment, law)).all()
            seconds.append(
                best(lambda e=experiment, c=law: fp.evaluate(e, [c] * runs), max(repeats - 2, 1))
            )
        each = 1e6 * (seconds[1] - seconds[0]) / 500 / runs
        found.append(each)
        data, model, zero = arm.model.createData(), arm.model, np.zeros(n)
        aba = 1e3 * best(
            lambda m=model, d=data, z=zero: [pin.aba(m, d, z, z, z) for _ in range(1000)], repeats
        )
        print(f"| {n} | {each:.2f} | {each / n:.3f} | {aba:.2f} |")
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(figsize=(5.5, 3.6), constrained_layout=True)
    axes.plot(counts, found, "o-")
    axes.set(xlabel="joints", ylabel=f"us a run-step, {runs} runs", ylim=(0, None), xlim=(0, None))
    axes.grid(alpha=0.3)
    figure.savefig(Path(__file__).parent / "results" / "joints.png", dpi=110)


def panda(repeats: int) -> None:
    """Time one run of twenty seconds of the Panda, with compiled dynamics."""
    arm = fp.Arm.from_example("panda")
    experiment = fp.Experiment(
        arm, Sinusoid(0.2, 1.0, offset=arm.home), q0=arm.home, dynamics="compiled"
    )
    law = fp.suggest_gains(arm)
    assert fp.simulate(experiment, law).outcome.completed
    seconds = best(lambda: fp.evaluate(experiment, law), repeats)
    print(f"\nPanda, 20 s at 1 ms, one run, compiled dynamics: {1e3 * seconds:.0f} ms")


def search(generations: int, workers: int, dynamics: str) -> None:
    """Time the paper's whole search, 60 candidates a generation, 20 s at 1 ms each.

    The plain loop is timed on 2,000 steps between generations, the search's clock stopped, and
    extrapolated. Bit-identical candidates are simulated again, so that the count is honest.
    """
    controller = fp.paper_controller(supervised=False)
    experiment = dataclasses.replace(fp.paper_experiment(), dynamics=dynamics)
    part, steps = fp.paper_experiment(duration=2.0), 2000
    plain: list[float] = []
    aba: list[float] = []
    paused = 0.0
    seen: set[int] = set()

    def measure() -> None:
        nonlocal paused
        began = time.perf_counter()
        plain_loop(part, controller, part.rows)
        plain.append((time.perf_counter() - began) / steps)
        aba.append(1e-9 * aba_ns(1))
        paused += time.perf_counter() - began

    def told(progress: SearchProgress) -> None:
        if progress.complete and progress.generation not in seen and progress.generation % 8 == 0:
            seen.add(progress.generation)
            measure()

    with WorkerPool(workers) if workers else nullcontext() as pool:
        if pool is not None:
            # Workers have started and imported the package before the clock does.
            short = dataclasses.replace(experiment, duration=0.1)
            fp.evaluate(short, [controller] * 8, executor=pool)
        measure()
        paused = 0.0
        began = time.perf_counter()
        result = fp.tune(
            experiment, controller, Space(integral_order=(0, 1), derivative_order=(0, 1)),
            QuadraticCost(1.0, 0.0),
            SearchSettings(generations=generations, reuse=False, executor=pool), progress=told,
        )  # fmt: skip
        seconds = time.perf_counter() - began - paused
    run_steps = result.evaluations * (experiment.rows - 1)
    each, one, unit = seconds / run_steps, float(np.median(plain)), float(np.median(aba))
    print(f"60 x {generations} candidates, {run_steps / 1e6:.1f} million steps, {workers} workers:")
    print(f"{seconds:.0f} s, {1e9 * each:.0f} ns a run-step, {each / unit:.3f} pin.aba calls")
    print(f"plain loop {1e9 * one:.0f} ns a step, {one / unit:.1f} pin.aba calls; the whole search")
    print(f"by it, extrapolated: {one * run_steps / 60:.0f} min; ratio {one / each:.1f}")
    print(f"at 708 ns a pin.aba call: {708 * each / unit:.0f} ns a run-step")
    print(f"cost {result.cost:.5f} at {result.parameters}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=int, default=2000)
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--joints", action="store_true", help="also the cost against joints")
    parser.add_argument("--search", type=int, metavar="GENERATIONS", help="only a whole search")
    parser.add_argument("--workers", type=int, default=2, help="of the search; 0: this process")
    parser.add_argument("--dynamics", choices=("pinocchio", "compiled"), default="pinocchio")
    options = parser.parse_args()
    if options.search:
        search(options.search, options.workers, options.dynamics)
        return
    headline(options.steps, options.repeats, options.dynamics)
    if options.dynamics == "compiled":
        panda(options.repeats)
    importing(options.repeats)
    if options.joints:
        joints(options.repeats)


if __name__ == "__main__":
    main()
