"""Time the engine: whole steps of every law, beside `pin.aba` and a plain loop.

    python benchmarks/speed.py [--search] [--quick]

All figures are ratios in one process; times are processor time, the best of some turns. What a
step costs is the difference between a longer and a shorter run, so that no start is counted. The
unit is one `pin.aba` call from Python on the same arm. Writes benchmarks/results/speed.md.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial

import numpy as np
import pinocchio as pin
from common import Report, arm_of, table
from own_fractional_law import NormalisedMit
from plain_loop import plain_loop

import fpid_pin as fp
from fpid_pin.costs import QuadraticCost
from fpid_pin.references import Sinusoid
from fpid_pin.tuning import SearchSettings, Space

#: Steps of the shorter and the longer run, of one robot and of each of sixty.
STEPS = {1: (500, 2500), 60: (100, 500)}


def turn_by_turn(
    works: list[Callable[[], object]], repeats: int, clock: Callable[[], float] = time.process_time
) -> list[float]:
    """Return the least time of each of some works [s].

    They take turns, so that a machine that is slow for a while is slow for all of them.
    """
    times = [np.inf] * len(works)
    for _ in range(repeats):
        for k, work in enumerate(works):
            began = clock()
            work()
            times[k] = min(times[k], clock() - began)
    return times


def aba_calls(arm: fp.Arm, count: int = 1000) -> Callable[[], None]:
    """Return a work of so many `pin.aba` calls from Python: the unit of this machine."""
    model, data = arm.model, arm.model.createData()
    q, zero = np.array(arm.home), np.zeros(arm.n)

    def many() -> None:
        for _ in range(count):
            pin.aba(model, data, q, zero, zero)

    return many


def laws() -> dict[str, fp.Controller]:
    """Return the laws that are timed, gains per unit of inertia."""
    fpid = {"kp": 100, "ki": 100, "kd": 20, "integral_order": 0.9, "derivative_order": 0.9,
            "learning_rate": 1.0, "scale": "inertia"}  # fmt: skip
    guard = fp.Supervisor(m_x=9.0, reference_bound=4.0, observer=40.0)
    return {
        "adaptive FPID, 24 modes": fp.AdaptiveFpid(**fpid),
        "PID": fp.Pid(100, 50, 20, scale="inertia"),
        "PD + gravity": fp.PdGravity(kp=100, kd=20, scale="inertia"),
        "computed torque": fp.ComputedTorque(k0=64, k1=16),
        "sliding mode": fp.SlidingMode(slope=4, gain=5, scale="inertia"),
        "Slotine-Li": fp.SlotineLi(slope=4, damping=4, scale="inertia"),
        "FPID + feedforward + observer": fp.AdaptiveFpid(**fpid, feedforward=True, observer=40.0),
        "and the sampled supervisor": fp.AdaptiveFpid(
            **fpid, feedforward=True, observer=40.0, supervisor=guard
        ),
    }


def experiment_of(arm: fp.Arm, steps: int) -> fp.Experiment:
    reference = Sinusoid(0.2, 1.0, offset=arm.home)
    return fp.Experiment(arm, reference, q0=arm.home, duration=steps * 1e-3)


def steps_of(arm: fp.Arm, law: fp.Controller, runs: int) -> list[Callable[[], object]]:
    """Return a shorter and a longer run of so many robots, compiled dynamics."""
    return [partial(fp.evaluate, experiment_of(arm, steps), [law] * runs) for steps in STEPS[runs]]


def marginal(times: list[float], runs: int) -> float:
    """Return the time of a step of one robot, by a shorter and a longer run [s]."""
    short, long = STEPS[runs]
    return (times[1] - times[0]) / (long - short) / runs


def whole_steps(repeats: int) -> list[str]:
    """Return the table of all laws on three arms, in calls of `pin.aba`."""
    arms = [arm_of(name) for name in ("two_link", "ur5", "panda")]
    units = dict.fromkeys((arm.name for arm in arms), np.inf)
    steps: dict[str, list[list[float]]] = {name: [] for name in laws()}
    for arm in arms:
        for name, law in laws().items():
            fp.evaluate(experiment_of(arm, 2), law)
            works = [aba_calls(arm), *steps_of(arm, law, 1), *steps_of(arm, law, 60)]
            unit, *times = turn_by_turn(works, repeats)
            units[arm.name] = min(units[arm.name], unit / 1000)
            steps[name].append([marginal(times[:2], 1), marginal(times[2:], 60)])
    rows = [
        [name, *(f"{one / unit:.2f} / {sixty / unit:.2f}"
                 for (one, sixty), unit in zip(each, units.values(), strict=True))]
        for name, each in steps.items()
    ]  # fmt: skip
    told = ", ".join(f"{name} {1e6 * unit:.2f}" for name, unit in units.items())
    heads = ["law", *(f"{name}, one / sixty" for name in units)]
    return [*table(heads, rows), f"one pin.aba call [us]: {told}"]


def own_law(repeats: int) -> str:
    """Return what a fractional law of one's own costs beside the built-in one."""
    arm = fp.Arm.from_example("ur5")
    own = NormalisedMit(kp=100.0, ki=100.0, kd=20.0, scale="inertia")
    ours = laws()["adaptive FPID, 24 modes"]
    fp.evaluate([experiment_of(arm, 2)] * 2, [own, ours])
    times = turn_by_turn([*steps_of(arm, own, 1), *steps_of(arm, ours, 1)], repeats)
    ratio = marginal(times[:2], 1) / marginal(times[2:], 1)
    return f"a fractional law of one's own takes {ratio:.2f} of ours (ur5)"


def against_plain_loop(repeats: int) -> list[str]:
    """Return the ratio to the plain loop, for one robot and sixty."""
    experiment, law = fp.paper_experiment(duration=4.0), fp.paper_controller(supervised=False)
    apart = np.abs(plain_loop(experiment, law, 4001) - fp.simulate(experiment, law).q).max()
    arm = experiment.arm
    works = [aba_calls(arm), partial(plain_loop, experiment, law, 501)]
    for runs, steps in STEPS.items():
        es = [fp.paper_experiment(duration=1e-3 * count) for count in steps]
        works += [partial(fp.evaluate, e, [law] * runs) for e in es]
    unit, plain, *times = turn_by_turn(works, repeats)
    unit, plain = unit / 1000, plain / 501
    one, sixty = plain / marginal(times[:2], 1), plain / marginal(times[2:], 60)
    return [
        f"the plain loop takes {1e6 * plain:.1f} us a step ({plain / unit:.1f} pin.aba), and "
        f"agrees within {apart:.0e} rad",
        f"ours is {one:.0f} times as fast for one robot, {sixty:.0f} times for sixty",
    ]


def loop_ticks(repeats: int) -> list[str]:
    """Return what a tick of `Loop` costs on the Panda, in calls of `pin.aba`."""
    arm = fp.Arm.from_example("panda")
    q, zero = np.array(arm.home), np.zeros(arm.n)
    lines = []
    for name in ("adaptive FPID, 24 modes", "and the sampled supervisor"):
        loop = laws()[name].start(arm, step=1e-3)

        def many(loop: fp.control.Loop = loop) -> None:
            for _ in range(1000):
                loop.torque(q, zero, q, zero, zero)

        unit, taken = turn_by_turn([aba_calls(arm), many], repeats)
        lines.append(f"a tick of Loop, Panda, {name}: {taken / unit:.2f} pin.aba")
    return lines


def threads(repeats: int) -> str:
    """Return how much faster two threads are than one, by the clock."""
    arm = fp.Arm.from_example("ur5")
    # As long as a candidate of the paper's search: the start of a run, in Python, is not shared.
    law, e = laws()["adaptive FPID, 24 modes"], experiment_of(arm, 20_000)
    works = [partial(fp.evaluate, e, [law] * 60, workers=workers) for workers in (1, 2)]
    one, two = turn_by_turn(works, repeats, time.perf_counter)
    return f"two threads over sixty UR5s: {one / two:.2f} times one"


def compiling() -> list[str]:
    """Return how long it takes to compile, in an empty cache and a full one."""
    code = (
        "import time, fpid_pin as fp\n"
        "def timed(c):\n"
        "    t = time.process_time(); fp.evaluate(fp.paper_experiment(duration=.01), c)\n"
        "    return time.process_time() - t\n"
        "import fpid_pin.simulation.batch\n"
        "laws = [fp.Pid(1, 1, 1), fp.paper_controller(), fp.ComputedTorque(),"
        " fp.SlidingMode(1, 1), fp.SlotineLi(1, 1)]\n"
        "print(*[f'{timed(c):.2f}' for c in laws])"
    )
    with tempfile.TemporaryDirectory() as folder:
        told = [
            subprocess.run(
                [sys.executable, "-c", code], capture_output=True, check=True, text=True,
                env={**os.environ, "NUMBA_CACHE_DIR": folder},
            ).stdout.strip()
            for _ in range(2)
        ]  # fmt: skip
    names = "engine with PID, then FPID, computed torque, sliding mode, Slotine-Li"
    return [f"compiling [s], {names}: {told[0]}", f"the same from the cache: {told[1]}"]


def search(generations: int) -> list[str]:
    """Time the paper's whole search, 60 candidates a generation, 20 s at 1 ms each."""
    law, e = fp.paper_controller(supervised=False), fp.paper_experiment()
    fp.evaluate(fp.paper_experiment(duration=0.01), law)
    began = time.perf_counter()
    result = fp.tune(
        e, law, Space(integral_order=(0, 1), derivative_order=(0, 1)), QuadraticCost(1.0, 0.0),
        SearchSettings(generations=generations, workers=2),
    )  # fmt: skip
    seconds = time.perf_counter() - began
    steps = result.simulations * (e.rows - 1)
    unit = turn_by_turn([aba_calls(e.arm)], 25)[0] / 1000
    return [
        f"60 x {generations} candidates of 20 s, {result.simulations} simulated, two threads: "
        f"{seconds:.1f} s, "
        f"{1e9 * seconds / steps:.0f} ns a step by the clock, {seconds / steps / unit:.3f} "
        f"pin.aba; cost {result.cost:.5f}"
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--search", action="store_true", help="also the paper's whole search")
    parser.add_argument("--quick", action="store_true", help="fewer turns")
    options = parser.parse_args()
    repeats = 5 if options.quick else 25
    report = Report(*whole_steps(repeats))
    report.add("", own_law(repeats), *against_plain_loop(repeats), *loop_ticks(repeats))
    report.add(threads(max(repeats // 5, 2)), *compiling())
    if options.search:
        report.add(*search(80))
    report.write("speed.md")


if __name__ == "__main__":
    main()
