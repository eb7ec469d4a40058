"""The adaptive FPID beside the controllers that people use, by a protocol that is fair to all.

    python benchmarks/baselines.py search two_link --minutes 8    # again and again: it goes on
    python benchmarks/baselines.py report two_link

Laws start on their reference; all have an integral or an observer or adapt; integrals, learning
rates and observers may be found to be worth nothing, orders may become 1. Each is searched, for
five seeds, until it no longer improves, on arms unlike its model (a few a seed), and tried on
others, other motions and harder conditions. A family that contains another also starts from the
best of that one. What is made small is the RMS error of the last half, the torque's variation
being limited, the same for all. `report` writes benchmarks/results/baselines-ARM.md.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import time
import warnings
from pathlib import Path

import numpy as np
from common import RESULTS, Report, tail, variation
from contestants import AT, FAMILIES, MIDDLE, Family
from converging import INWARDS, LONGEST, PATIENCE, SHORTEST, SIZE, SPREAD, Track, converge, load
from protocol import Job, excess, jobs
from verdict import Trial, best_of, draw, written

import fpid_pin as fp
from fpid_pin import descriptions

SEEDS = range(5)


class Searches:
    """All searches on one arm, and their checkpoints."""

    def __init__(self, job: Job, folder: Path, workers: int | None) -> None:
        self.job, self.folder, self.workers = job, folder / job.name, workers
        self.training = {seed: job.training(seed) for seed in SEEDS}

    def place(self, name: str) -> tuple[Path, str]:
        """Return the checkpoint of a family, and a fingerprint of what its search depends on."""
        told = [descriptions.to_dict(e) for es in self.training.values() for e in es]
        rule = (SIZE, SPREAD, PATIENCE, SHORTEST, LONGEST, AT, INWARDS, MIDDLE)
        text = repr((json.dumps(told), self.job.quiet, FAMILIES[name].space, rule))
        path = self.folder / f"{name.replace(' ', '-')}.search"
        return path, hashlib.sha256(text.encode()).hexdigest()

    def load(self, name: str) -> list[Track]:
        """Return the searches of a family, finished or not."""
        return load(*self.place(name)) or []

    def fresh(self, family: Family) -> list[Track]:
        """Return three searches a seed; some start from the best law known to be in the family."""
        tracks, size = [], len(family.space)
        for seed in SEEDS:
            tracks.append(Track("alone", seed, size))
            known = []
            for name in family.contains:
                track = best_of(self.load(name), seed)
                known.append((track.best, family.point(FAMILIES[name].genes(track.point))))
            if not known:
                tracks += [Track(label, seed, size) for label in ("once more", "a third time")]
                continue
            start = min(known, key=lambda pair: pair[0])[1]
            tracks.append(Track("from a part of it", seed, size, start))
            if "mu" in family.space:
                start = family.with_orders(start, *MIDDLE)
                tracks.append(Track("from there with other orders", seed, size, start))
            else:
                tracks.append(Track("once more alone", seed, size))
        return tracks

    def run(self, name: str, until: float) -> bool:
        """Search a family; return whether it came to an end."""
        family, job = FAMILIES[name], self.job

        def cost(pairs: list[tuple[int, np.ndarray]]) -> np.ndarray:
            laws = [family.build(job.arm, job.scale, family.genes(x)) for _, x in pairs]
            owners, experiments = zip(
                *((k, e) for k, (seed, _) in enumerate(pairs) for e in self.training[seed]),
                strict=True,
            )
            costs = fp.evaluate(
                experiments, [laws[k] for k in owners], job.cost, workers=self.workers
            )
            return costs.reshape(len(pairs), -1).mean(axis=1)

        tracks = converge(*self.place(name), lambda: self.fresh(family), cost, until)
        found = (
            [1e3 * best_of(tracks, seed).best for seed in SEEDS] if tracks else "to be continued"
        )
        print(f"{job.name}: {name}: {found}", flush=True)
        return tracks is not None

    def trial(self, name: str) -> dict[str, Trial]:
        """Try the best laws of a family, one a seed, under every condition."""
        tracks, family, job = self.load(name), FAMILIES[name], self.job
        points = [best_of(tracks, seed).point for seed in SEEDS]
        laws = [family.build(job.arm, job.scale, family.genes(x)) for x in points]
        trials = {}
        for condition, experiments in job.conditions().items():
            values = np.full((3, len(laws), len(experiments)), np.inf)
            for row, law in enumerate(laws):
                for column, (e, run) in enumerate(
                    zip(experiments, fp.simulate(experiments, law), strict=True)
                ):
                    if run.outcome.completed:
                        moved = 1e-3 * variation(run) / run.t[-1]
                        values[:, row, column] = tail(run), excess(e, run, job.w2), moved
            trials[condition] = Trial(*values)
        return trials


def main() -> None:
    """Search for a while, or report what was found."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawTextHelpFormatter
    )
    parser.add_argument("what", choices=("search", "report"))
    parser.add_argument("arm", choices=("two_link", "ur5", "panda"))
    parser.add_argument("--minutes", type=float, default=8.0, help="then stop, to be continued")
    parser.add_argument("--families", nargs="+", default=list(FAMILIES), choices=list(FAMILIES))
    parser.add_argument("--workers", type=int, help="threads")
    parser.add_argument("--checkpoints", type=Path, default=Path("runs/baselines"))
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    searches = Searches(jobs()[options.arm], options.checkpoints, options.workers)
    done = {n: all(t.done for t in found) if (found := searches.load(n)) else False
            for n in options.families}  # fmt: skip
    if options.what == "search":
        until = time.monotonic() + 60.0 * options.minutes
        for name in options.families:
            if not done[name] and not searches.run(name, until):
                break
        return
    ready = {name: searches.load(name) for name in options.families if done[name]}
    unfinished = {
        name: max((len(track.history) for track in searches.load(name)), default=0)
        for name in options.families
        if not done[name]
    }
    trials = {name: searches.trial(name) for name in ready}
    text = written(searches.job, ready, trials, unfinished)
    Report(*text.splitlines()).write(f"baselines-{options.arm}.md")
    draw(trials, RESULTS / f"baselines-{options.arm}.png", options.arm)


if __name__ == "__main__":
    main()
