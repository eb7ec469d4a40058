"""Is it better than what I use now?

A case is a configuration in benchmarks/cases: an arm, a motion, controllers, what the controllers
do not know of the plant, and where all that comes from. Every controller is tuned by the same
budget for the same seeds (`fp.tune`, plants of each seed's own, from what is uncertain), the RMS
error of the last half being made small and the torque's variation limited, the same for all. Then
all of them meet plants that none was trained on, other motions, and harder conditions. Figures are
medians over seeds and plants; intervals are 95 % bootstraps of these, both drawn anew.

Parts are the cases, and plants: the laws of the first seed on ten thousand two-link arms. Searches
have checkpoints in runs/referee: started again they go on.
"""

import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from common import Bench, on_reference, panels, run, tail, variation

import fpid_pin as fp
from fpid_pin import descriptions
from fpid_pin.campaign import Distribution, Scenarios, Study
from fpid_pin.campaign.statistics import scored, wilson
from fpid_pin.cli.configuration import Config, parse
from fpid_pin.costs import Cost, Metrics
from fpid_pin.references import Reference
from fpid_pin.tuning import RobustCost, SearchSettings, Space, TuningResult, tune

CASES = Path(__file__).parent / "cases"
HELD_OUT_SEED = 1000  # of the plants; training has seeds of its own below
#: Who is set against whom; the last is set against every rival.
PAIRS = (
    ("FPID", "PID"), ("adaptive PID", "PID"), ("adaptive FPID", "FPID"),
    ("FPID + model", "PID + model"), ("adaptive FPID + model", "FPID + model"),
    ("FPID + model", "FPID"),
)  # fmt: skip
OURS = "FPID + model"
RIVALS = (
    "PID + G + observer", "computed torque + I + observer", "sliding mode + observer", "Slotine-Li",
)  # fmt: skip


@dataclass(frozen=True)
class TailCost(Cost):
    """RMS error over all joints, last half of the run, where the torque keeps quiet.

    A law can always buy accuracy by gains that turn noise into torque. So what varies more than is
    allowed multiplies the cost, by the square of the excess: that never pays.
    """

    quiet: float  # total variation allowed [N m]

    def of(self, metrics: Metrics) -> float:
        rms = float(np.sqrt(np.mean(metrics.rms_tail**2)))
        return rms * max(1.0, float(metrics.total_variation.sum()) / self.quiet) ** 2


@dataclass(frozen=True)
class Case:
    """A case, and what is asked of every law in it."""

    name: str
    bench: Bench

    @cached_property
    def config(self) -> Config:
        """The case's configuration, with the controllers that all cases have."""
        text = "".join((CASES / f"{x}.toml").read_text() for x in (self.name, "controllers"))
        return parse(text, f"{self.name}.toml", CASES)

    @property
    def seeds(self) -> range:
        return range(1 if self.bench.quick else 5)

    def studied(self, seed: int, changed: Mapping[str, Any] | None = None) -> Study:
        """Return what is uncertain, under a condition's table of what is otherwise."""
        changed, e = dict(changed or {}), self.config.experiment
        if "reference" in changed:
            found = descriptions.from_dict(changed.pop("reference"), Reference, "reference")
            e = replace(e, reference=found)
        if "effort_limit" in changed:
            limited = replace(e.plant, effort_limit=changed.pop("effort_limit"))
            e = replace(e, plant=limited)
        uncertain = self.config.campaign["uncertain"] | changed.pop("uncertain", {})
        uncertain = {
            key: descriptions.from_dict(table, Distribution, f"uncertain.{key}")
            for key, table in uncertain.items()
        }
        e = replace(e, **on_reference(e.reference), **changed)
        return Study(e, self.config.controllers, Scenarios(uncertain, seed=seed), self.name)

    def plants(self, study: Study, count: int) -> list[fp.Experiment]:
        """Return experiments on the first plants of a study."""
        return [study.experiment_of(k, x) for k, x in enumerate(study.samples(0, count))]

    @cached_property
    def searches(self) -> dict[str, list[TuningResult]]:
        """The searches of all laws, by name, one a seed."""
        table, found, spaces = self.config.tune, {}, {}
        duration = self.config.experiment.duration
        cost = RobustCost(TailCost(table["variation"] * duration), "mean")
        training = [self.plants(self.studied(seed), 1 if self.bench.quick else 3)
                    for seed in self.seeds]  # fmt: skip
        size = {"population": 4, "generations": 1} if self.bench.quick else {"generations": 60}
        for name, search in table["search"].items():
            part, law = search.get("starts_from"), self.config.controllers[name]
            spaces[name] = {**spaces.get(part, {}), **search["space"]}
            found[name] = []
            for seed in self.seeds:
                if part is not None:
                    best = found[part][seed].controller
                    law = replace(law, **{k: getattr(best, k) for k in spaces[part]})
                    # What the smaller family lacks it has as its own: orders 1, no adaptation.
                    law = replace(law, **{k: getattr(best, k) for k in search["space"]})
                path = Path("runs/referee", self.name, f"{name}-{seed}.npz".replace(" ", "-"))
                path.parent.mkdir(parents=True, exist_ok=True)
                kept = {} if self.bench.quick else {"checkpoint": path, "resume": True}
                settings = SearchSettings(**size, **kept, seeds=(seed,), workers=self.bench.workers)
                result = tune(training[seed], law, Space(**spaces[name]), cost, settings)
                found[name].append(result)
                print(f"{self.name}, {name}, seed {seed}: {result}", flush=True)
        return found

    def trials(self) -> Iterator[tuple[str, str, np.ndarray]]:
        """Yield condition, law, and (2, seeds, plants): tail errors [mrad], variation [N m/s]."""
        for condition, changed in self.config.tune["conditions"].items():
            study = self.studied(HELD_OUT_SEED, changed)
            experiments = self.plants(study, 2 if self.bench.quick else 12)
            for name, results in self.searches.items():
                runs = [fp.simulate(experiments, x.controller) for x in results]
                yield condition, name, np.array([
                    [[tail(x) for x in row] for row in runs],
                    [[variation(x) / x.t[-1] if x.outcome.completed else np.inf for x in row]
                     for row in runs],
                ])  # fmt: skip


def interval(values: np.ndarray) -> tuple[float, float, float]:
    """Return the median of (seeds, plants) and the ends of its bootstrap interval."""
    rng, (seeds, plants) = np.random.default_rng(0), values.shape
    rows = rng.integers(seeds, size=(2000, seeds))
    columns = rng.integers(plants, size=(2000, plants))
    drawn = values[rows[:, :, np.newaxis], columns[:, np.newaxis, :]].reshape(2000, -1)
    ends = np.quantile(np.median(drawn, axis=1), (0.025, 0.975), method="nearest")
    return float(np.median(values)), float(ends[0]), float(ends[1])


def told(cell: tuple[float, float, float], bold: bool = False) -> str:
    """Return a median and its interval as text."""
    middle, low, high = (f"{x:.3g}" if np.isfinite(x) else "div." for x in cell)
    text = f"{middle} ({low} to {high})"
    return f"**{text}**" if bold else text


def ratio(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Return ours/theirs, run by run: 0 where only they diverged, inf where only we, 1 for both."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(ours) & np.isinf(theirs), 1.0, ours / theirs)


def judged(cell: tuple[float, float, float]) -> str:
    """Return what a ratio with its interval says."""
    word = "better" if cell[2] < 1.0 else "worse" if cell[1] > 1.0 else "no different for sure"
    return f"{word}, {told(cell)}"


def referee(name: str, bench: Bench) -> None:
    """Print the verdict on a case, and its tables."""
    case = Case(name, bench)
    found: dict[str, dict[str, np.ndarray]] = {}
    for condition, law, values in case.trials():
        found.setdefault(condition, {})[law] = values
    first = next(iter(found))
    errors = {law: interval(values[0]) for law, values in found[first].items()}
    best = min(errors, key=lambda law: errors[law][0])
    pairs = [*PAIRS, *((OURS, rival) for rival in RIVALS)]
    ratios = {
        (ours, theirs): [interval(ratio(x[ours][0], x[theirs][0])) for x in found.values()]
        for ours, theirs in pairs
    }
    rival = min(RIVALS, key=lambda law: errors[law][0])
    bench.say(
        f"**{name}** ({case.config.tune['source']}): on held-out arms {best} errs least, "
        f"{told(errors[best])} mrad. By the ratio of tail errors, run by run, FPID beside PID is "
        f"{judged(ratios['FPID', 'PID'][0])}; with the model of both "
        f"{judged(ratios['FPID + model', 'PID + model'][0])}; {OURS} beside the best rival, "
        f"{rival}, is {judged(ratios[OURS, rival][0])}."
    )
    heads = ["controller", *found]
    bench.details(f"{name}: tail RMS error [mrad], the least of a column bold; lost runs")
    bench.table(heads, rows_of(found, 0))
    bench.details(f"{name}: ratio of tail errors, bold where its interval leaves 1 out")
    bench.table(
        ["", *found],
        ([f"{ours} / {theirs}", *(told(c, c[2] < 1.0 or c[1] > 1.0) for c in cells)]
         for (ours, theirs), cells in ratios.items()),
    )  # fmt: skip
    bench.details(f"{name}: variation of the torque [N m/s]")
    bench.table(heads, rows_of(found, 1))
    bench.details(f"{name}: what the searches found, a column a seed")
    rows = []
    for law, results in case.searches.items():
        rows.append([law, "cost [mrad]", *(f"{1e3 * x.cost:.3g}" for x in results)])
        rows += [[law, key, *(f"{x.parameters[key]:.4g}" for x in results)]
                 for key in results[0].parameters]  # fmt: skip
        rows.append([law, "", *(x.advice[-1] for x in results)])
    bench.table(["controller", "parameter", *map(str, case.seeds)], rows, 2)
    bench.figure(drawn(found, name), f"referee-{name}.png", f"Tail errors: {name}")


def rows_of(found: dict[str, dict[str, np.ndarray]], figure: int) -> list[list[str]]:
    """Return a row a controller, a cell a condition: median, interval, how many runs were lost."""
    rows = [[law] for law in next(iter(found.values()))]
    for laws in found.values():
        cells = [interval(values[figure]) for values in laws.values()]
        least = min(middle for middle, _, _ in cells)
        for row, values, cell in zip(rows, laws.values(), cells, strict=True):
            lost = int(np.isinf(values[0]).sum())
            text = told(cell, bold=cell[0] == least and np.isfinite(least))
            row.append(text + (f"; {lost} lost" if lost else ""))
    return rows


def drawn(found: dict[str, dict[str, np.ndarray]], title: str) -> Any:
    """Draw tail errors, a panel a condition: medians and intervals; filled where fractional."""
    columns, far = 3, 20.0  # [mrad]
    lines = -(-len(found) // columns)
    figure, axes = panels((12.0, 2.7 * lines), lines, columns, sharex=True, sharey=True)
    for axis, (condition, laws) in zip(axes.flat, found.items(), strict=False):
        for y, (law, values) in enumerate(reversed(laws.items())):
            middle, low, high = np.minimum(interval(values[0]), far)
            colour = {"+ model": "tab:orange", "PID": "tab:blue"}.get(
                next((end for end in ("+ model", "PID") if law.endswith(end)), ""), "0.35"
            )
            axis.plot([low, high], [y, y], color=colour, lw=1.6)
            axis.plot(middle, y, "o", color=colour, mfc=colour if "FPID" in law else "w")
        axis.set(xscale="log", xlabel="tail RMS error [mrad]", title=condition)
        axis.set_yticks(range(len(laws)), list(reversed(laws)), fontsize=8)
        axis.grid(axis="x", which="both", color="0.9", lw=0.6)
        axis.label_outer()
    for axis in axes.flat[len(found) :]:
        axis.set_visible(False)
    figure.suptitle(
        f"{title}: median over seeds and arms, 95 % interval; what errs more at {far:g}"
    )
    return figure


def plants(bench: Bench) -> None:
    case, count = Case("two_link", bench), 40 if bench.quick else 10_000
    laws = {name: results[0].controller for name, results in case.searches.items()}
    study = replace(case.studied(HELD_OUT_SEED + 1), controllers=laws)
    with tempfile.TemporaryDirectory() as folder:
        data = fp.campaign.run(study, Path(folder, "ledger"), count, workers=bench.workers)
    scores = 1e3 * scored(data, "rms_tail")
    best = (scores == scores.min(axis=1, keepdims=True)) & np.isfinite(scores)
    rows = []
    for k, label in enumerate(data.controllers):
        rate = wilson(int(np.isfinite(scores[:, k]).sum()), count)
        middle, late = np.quantile(scores[:, k], (0.5, 0.9), method="higher")
        rows.append([label, f"{100 * rate.low:.2f} to {100 * rate.high:.2f} %", f"{middle:.3g}",
                     f"{late:.3g}", f"{100.0 * best[:, k].mean():.1f} %"])  # fmt: skip
    winner = min(rows, key=lambda row: float(row[3]))
    bench.details(f"Who holds on {count:,} two-link arms? The laws of seed 0")
    bench.say(f"At the 90th percentile {winner[0]} errs least, {winner[3]} mrad.")
    bench.table(["law", "success, 95 %", "median [mrad]", "90 % [mrad]", "best on"], rows)


if __name__ == "__main__":
    cases = {name: partial(referee, name) for name in ("two_link", "ur5", "panda")}
    run(__doc__, plants, **cases)
