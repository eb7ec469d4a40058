"""Time campaigns: what recording thousands of plants costs beside the engine alone, and scaling.

    python benchmarks/robustness.py [--plants 10000] [--duration 10] [--arm two_link|ur5] [--dask]

Engine: whole runs on plants that are there already, 64 at a time, nothing recorded. Campaign: from
the call to the last row in the ledger. Both by the clock and by the processor's time, which others
on the machine do not lengthen as much. Asked: at most 1.35 times the engine's time for as many
run-steps with two workers, memory under 1 GB, efficiency from 1 to 2 workers at least 0.85.
"""

from __future__ import annotations

import argparse
import os
import resource
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import numpy as np
from common import arm_of, table

import fpid_pin as fp
from fpid_pin.campaign import LogUniform, Scenarios, Study, Uniform
from fpid_pin.campaign.driver import CHUNK
from fpid_pin.simulation.batch import advance_all, start_robots

UNCERTAIN = {
    "mass": Uniform(low=0.8, high=1.2),
    "inertia": Uniform(low=0.8, high=1.2),
    "payload": Uniform(low=0.0, high=1.0),
    "viscous_friction": Uniform(low=0.0, high=0.2),
    "disturbance_amplitude": LogUniform(low=0.1, high=2.0),
    "disturbance_frequency": Uniform(low=1.0, high=20.0, shared=True),
}


def study(arm: str, duration: float) -> Study:
    """Return the campaign: the paper's law, or one with suggested gains on a UR5."""
    if arm == "two_link":
        experiment = fp.paper_experiment(duration=duration)
        law = fp.paper_controller(supervised=False)
    else:
        robot = arm_of(arm)
        motion = fp.references.Sinusoid(amplitude=0.3, offset=robot.home)
        push = fp.disturbances.Cosine(amplitude=np.ones(robot.n))
        experiment = fp.Experiment(
            robot, motion, plant=fp.Plant(disturbance=push), duration=duration
        )
        law = fp.suggest_gains(robot, bandwidth=10.0, step=1e-3)
    return Study(experiment, {"fractional": law}, Scenarios(UNCERTAIN), arm)


def engine(made: Study, batches: int) -> float:
    """Return the processor's time of the engine alone for one run [s]."""
    (law,) = made.controllers.values()
    times = []
    for batch in range(batches):
        first = batch * CHUNK
        samples = enumerate(made.samples(first, first + CHUNK), start=first)
        experiments = [made.experiment_of(run, sample) for run, sample in samples]
        robots = start_robots(experiments, [law] * CHUNK, dynamics="compiled")
        began = time.process_time()
        advance_all(robots)
        times.append((time.process_time() - began) / CHUNK)
    return float(np.median(times))


def campaign(made: Study, plants: int, workers: int, dask: bool = False) -> tuple[float, float]:
    """Return clock's and processor's time [s] of a whole campaign; Dask's is its workers' own."""
    with tempfile.TemporaryDirectory() as folder, ExitStack() as stack:
        executor = None
        if dask:
            cluster = stack.enter_context(fp.campaign.local_cluster(workers))
            executor = stack.enter_context(
                fp.campaign.dask_executor(cluster.scheduler_address, patience=60.0)
            )
        ways = {"executor": executor} if dask else {"workers": workers}
        clock, spent = time.perf_counter(), time.process_time()
        fp.campaign.run(made, Path(folder, "l"), plants, **ways)
        return time.perf_counter() - clock, time.process_time() - spent


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--plants", type=int, default=10_000)
    parser.add_argument("--duration", type=float, default=10.0)
    parser.add_argument("--arm", default="two_link")
    parser.add_argument("--dask", action="store_true")
    options = parser.parse_args()
    made = study(options.arm, options.duration)
    fp.campaign.run(made, Path(tempfile.mkdtemp(), "warm"), 1)
    before = engine(made, 4)
    ways = [(1, False), (2, False), *([(2, True)] if options.dask else [])]
    found = {way: campaign(made, options.plants, *way) for way in ways}
    alone = 0.5 * (before + engine(made, 4))
    steps = made.experiment.rows - 1
    print(f"{options.arm}, {options.plants} plants x {options.duration:g} s, {steps} steps each; "
          f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} processors")  # fmt: skip
    print(f"engine alone: {1e9 * alone / steps:.0f} ns a run-step")
    rows, total = [], alone * options.plants
    for (workers, dask), (clock, spent) in found.items():
        shown = ["-", "-"] if dask else [f"{spent:.1f}", f"{spent / total:.2f}"]
        name = f"{workers}{' (Dask)' if dask else ''}"
        rows.append([name, f"{clock:.1f}", f"{clock * workers / total:.2f}", *shown])
    heads = ["workers", "clock [s]", "over engine", "processor [s]", "over engine"]
    print("\n".join(table(heads, rows)))
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
    print(f"memory at most {most:.0f} MB")
    print(f"efficiency from 1 to 2 workers: {found[1, False][0] / 2 / found[2, False][0]:.2f}")


if __name__ == "__main__":
    main()
