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
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path

import numpy as np
from contestants import AT, FAMILIES, MIDDLE, Family
from converging import INWARDS, LONGEST, PATIENCE, SHORTEST, SIZE, SPREAD, Track, converge, load
from protocol import Job, excess, jobs
from verdict import Trial, written
from verdict_picture import draw

import fpid_pin as fp
from fpid_pin import descriptions

SEEDS = range(5)


def best_of(tracks: list[Track], seed: int) -> Track:
    """Return the search that found most for a seed."""
    return min((t for t in tracks if t.seed == seed), key=lambda t: t.best)


class Searches:
    """All searches on one arm, and their checkpoints."""

    def __init__(self, job: Job, folder: Path) -> None:
        self.job, self.folder = job, folder / job.name
        self.training = {seed: job.training(seed) for seed in SEEDS}
        told = [descriptions.to_dict(e) for es in self.training.values() for e in es]
        self._experiments = hashlib.sha256(json.dumps(told).encode()).hexdigest()

    def path(self, name: str) -> Path:
        return self.folder / f"{name.replace(' ', '-')}.search"

    def fingerprint(self, name: str) -> str:
        """Return what a search depends on."""
        rule = (SIZE, SPREAD, PATIENCE, SHORTEST, LONGEST)
        family = FAMILIES[name]
        more = (AT, INWARDS, MIDDLE) if family.contains else ()
        text = repr((self._experiments, self.job.quiet, family.space, rule, *more))
        return hashlib.sha256(text.encode()).hexdigest()

    def load(self, name: str) -> list[Track] | None:
        """Return the finished searches of a family, or None."""
        tracks = load(self.path(name), self.fingerprint(name))
        return tracks if tracks and all(track.done for track in tracks) else None

    def generation(self, name: str) -> int:
        """Return how far an unfinished search has come, its longest track."""
        tracks = load(self.path(name), self.fingerprint(name)) or []
        return max((len(track.history) for track in tracks), default=0)

    def fresh(self, family: Family) -> list[Track]:
        """Return three searches a seed; some start from the best law known to be in the family."""
        tracks, size = [], len(family.space)
        for seed in SEEDS:
            known = []
            for name in family.contains:
                found = self.load(name)
                assert found is not None
                track = best_of(found, seed)
                known.append((track.best, family.point(FAMILIES[name].genes(track.point))))
            tracks.append(Track("alone", seed, size))
            if not known:
                tracks.append(Track("once more", seed, size))
                tracks.append(Track("a third time", seed, size))
                continue
            start = min(known, key=lambda pair: pair[0])[1]
            tracks.append(Track("from a part of it", seed, size, start))
            if "mu" in family.space:
                start = family.with_orders(start, *MIDDLE)
                tracks.append(Track("from there with other orders", seed, size, start))
            else:
                tracks.append(Track("once more alone", seed, size))
        return tracks

    def run(self, name: str, until: float, pool: Executor | None) -> bool:
        """Search a family; return whether it came to an end."""
        family, job = FAMILIES[name], self.job

        def cost(pairs: list[tuple[int, np.ndarray]]) -> np.ndarray:
            laws = [family.build(job.arm, job.scale, family.genes(x)) for _, x in pairs]
            table = [
                (experiment, laws[k], k)
                for seed in SEEDS
                for experiment in self.training[seed]
                for k, (own, _) in enumerate(pairs)
                if own == seed
            ]
            costs = fp.evaluate(
                [row[0] for row in table], [row[1] for row in table], job.cost, executor=pool
            )
            total, count = np.zeros((2, len(pairs)))
            for (_, _, k), one in zip(table, costs, strict=True):
                total[k] += one
                count[k] += 1
            return total / count

        began = time.process_time()
        tracks = converge(
            self.path(name), self.fingerprint(name), lambda: self.fresh(family), cost, until
        )
        took = time.process_time() - began
        if tracks is None:
            print(f"{job.name}: {name}: to be continued ({took:.0f} s)", flush=True)
            return False
        found = [1e3 * best_of(tracks, seed).best for seed in SEEDS]
        print(f"{job.name}: {name}: {np.round(found, 4)} mrad ({took:.0f} s)", flush=True)
        return True

    def laws(self, name: str) -> list[fp.Controller]:
        """Return the best law of each seed."""
        tracks, family = self.load(name), FAMILIES[name]
        assert tracks is not None
        points = [best_of(tracks, seed).point for seed in SEEDS]
        return [family.build(self.job.arm, self.job.scale, family.genes(x)) for x in points]

    def trial(self, name: str) -> dict[str, Trial]:
        """Try the best laws of a family under every condition; done once, then read."""
        path = self.path(name).with_suffix(".trial")
        stamp = hashlib.sha256(self.path(name).read_bytes()).hexdigest()
        if path.exists():
            known, rows = json.loads(path.read_text())
            if known == stamp:
                return {key: Trial(*map(np.array, row)) for key, row in rows.items()}
        trials = {}
        for condition, experiments in self.job.conditions().items():
            shape = (len(SEEDS), len(experiments))
            pairs = [(e, law) for law in self.laws(name) for e in experiments]
            runs = fp.simulate([e for e, _ in pairs], [law for _, law in pairs])
            values = np.full((3, len(pairs)), np.inf)
            for k, ((e, _), run) in enumerate(zip(pairs, runs, strict=True)):
                if run.outcome.completed:
                    m = run.metrics
                    values[0, k] = 1e3 * np.sqrt(np.mean(m.rms_tail**2))
                    values[1, k] = excess(e, run, self.job.w2)
                    values[2, k] = 1e-3 * m.total_variation.sum() / run.t[-1]
            trials[condition] = Trial(*values.reshape(3, *shape))
        rows = {key: [part.tolist() for part in trial] for key, trial in trials.items()}
        path.write_text(json.dumps([stamp, rows]))
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
    searches = Searches(jobs()[options.arm], options.checkpoints)
    if options.what == "search":
        until = time.monotonic() + 60.0 * options.minutes
        pool = ThreadPoolExecutor(options.workers) if options.workers else None
        for name in options.families:
            if searches.load(name) is None and not searches.run(name, until, pool):
                break
        if pool is not None:
            pool.shutdown()
        return
    found = {name: searches.load(name) for name in options.families}
    ready = {name: tracks for name, tracks in found.items() if tracks is not None}
    unfinished = {name: searches.generation(name) for name in found if name not in ready}
    trials = {}
    for name in ready:
        trials[name] = searches.trial(name)
        print(f"{options.arm}: tried {name}", flush=True)
    path = Path(__file__).parent / "results" / f"baselines-{options.arm}.md"
    path.write_text(written(searches.job, ready, trials, unfinished), encoding="utf-8")
    draw(trials, path.with_suffix(".png"), options.arm)
    print(path.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
