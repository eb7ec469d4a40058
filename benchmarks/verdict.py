"""Tables for `baselines.py`: medians with intervals, who is ahead, and which searches failed.

An interval is scipy's bootstrap (percentiles, 95 %) of the median over seeds and arms, both drawn
anew: with five seeds it says how much hangs on them, too.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from contestants import AT, FAMILIES
from converging import GAIN, LONGEST, PATIENCE, SIZE, Track
from protocol import HELD_OUT, STEP, TRAINING, Job

Trials = Mapping[str, Mapping[str, "Trial"]]
RESAMPLES = 2000

#: Whose ratios are shown: what fractional orders, adaptation and the model are worth, and how the
#: FPID with its model stands beside every rival.
PAIRS = (
    ("FPID", "PID"),
    ("adaptive FPID", "adaptive PID"),
    ("FPID + model", "PID + model"),
    ("adaptive FPID + model", "adaptive PID + model"),
    ("adaptive PID", "PID"),
    ("adaptive FPID", "FPID"),
    ("adaptive PID + model", "PID + model"),
    ("adaptive FPID + model", "FPID + model"),
    ("FPID + model", "computed torque + I + observer"),
    ("adaptive FPID + model", "adaptive FPID"),
    ("adaptive FPID + model", "PID + G + observer"),
    ("adaptive FPID + model", "computed torque + I + observer"),
    ("adaptive FPID + model", "sliding mode + observer"),
    ("adaptive FPID + model", "Slotine-Li"),
)


class Trial(NamedTuple):
    """What a family's laws did under a condition, (seeds, runs) each; inf where they diverged."""

    error: np.ndarray  # tail RMS over all joints [mrad]
    excess: np.ndarray  # cost (33) without what following exactly takes anyway
    variation: np.ndarray  # of the torque [kN m/s]


def interval(values: np.ndarray) -> tuple[float, float, float]:
    """Return the median of (seeds, runs) and the ends of its interval."""
    from scipy.stats import bootstrap

    def median(seeds: np.ndarray, runs: np.ndarray) -> float:
        return float(np.median(values[np.ix_(seeds.astype(int), runs.astype(int))]))

    every = [np.arange(size) for size in values.shape]
    middle = median(*every)
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        found = bootstrap(
            every, median, n_resamples=RESAMPLES, method="percentile", vectorized=False,
            rng=np.random.default_rng(0),
        )  # fmt: skip
    return middle, *found.confidence_interval


def number(x: float) -> str:
    return f"{x:.3g}" if np.isfinite(x) else "div."


def ratio(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Return ours/theirs, run by run: 0 where only they diverged, inf where only we, 1 for both."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(ours) & np.isinf(theirs), 1.0, ours / theirs)


def table(head: list[str], rows: list[list[str]]) -> list[str]:
    lines = ["| " + " | ".join(head) + " |", "| --- |" + " ---: |" * (len(head) - 1)]
    return [*lines, *("| " + " | ".join(row) + " |" for row in rows), ""]


def best(tracks: list[Track], label: str = "") -> np.ndarray:
    """Return the lowest cost of each seed [mrad], of all searches or of those so labelled."""
    seeds = sorted({t.seed for t in tracks})
    chosen = [[t.best for t in tracks if t.seed == s and label in t.label] for s in seeds]
    return 1e3 * np.array([min(costs) for costs in chosen])


def training(found: Mapping[str, list[Track]]) -> list[str]:
    """Return what the searches came to, and how far they still moved at the end."""
    head = [
        "controller", "numbers", "cost [mrad]: median (least, most)", "candidates a search",
        "cost at half of them", "worst of three searches / best", "cut short",
    ]  # fmt: skip
    rows = []
    for name, tracks in found.items():
        costs = best(tracks)
        half = [t.history[(len(t.history) - 1) // 2] / t.best for t in tracks]
        seeds = sorted({t.seed for t in tracks})
        both = [sorted(t.best for t in tracks if t.seed == seed) for seed in seeds]
        apart = [pair[-1] / pair[0] for pair in both]
        at = [f"x {np.median(x):.3f} (worst {max(x):.2f})" for x in (half, apart)]
        sizes = [SIZE * len(t.history) for t in tracks]
        rows.append(
            [
                name, str(len(FAMILIES[name].space)),
                f"{np.median(costs):.3g} ({costs.min():.3g}, {costs.max():.3g})",
                f"{min(sizes)} to {max(sizes)}", *at,
                f"{sum(len(t.history) >= LONGEST for t in tracks)} of {len(tracks)}",
            ]
        )  # fmt: skip
    return table(head, rows)


def nested(found: Mapping[str, list[Track]]) -> list[str]:
    """Say of every family that contains another whether its searches knew."""
    lines = []
    for name, tracks in found.items():
        for part in FAMILIES[name].contains:
            if part not in found:
                continue
            own, alone, less = best(tracks), best(tracks, "alone"), best(found[part])
            gain = own / less
            failed = int((alone > less * (1.0 + 1e-9)).sum())
            text = (
                f"- {name} contains {part}: its cost is {np.median(gain):.3f} of that one's "
                f"({gain.min():.3f} to {gain.max():.3f})"
            )
            if (gain > 1.0 + 1e-9).any():
                text += "; **worse somewhere: the optimiser failed**"
            if failed:
                text += (
                    f"; searched from nothing it was worse in {failed} of {len(less)} seeds, up to "
                    f"x {max(alone / less):.3f}: a failure of the optimiser, made good by the "
                    "start from the smaller family"
                )
            lines.append(text + ".")
    return [*lines, ""]


def parameters(found: Mapping[str, list[Track]]) -> list[str]:
    """Return the parameters of the best law of each seed: median, least and most."""
    lines = []
    for name, tracks in found.items():
        family, parts = FAMILIES[name], []
        seeds = sorted({t.seed for t in tracks})
        chosen = [min((t for t in tracks if t.seed == s), key=lambda t: t.best) for s in seeds]
        genes = [family.genes(track.point) for track in chosen]
        for key in family.space:
            values = [g[key] for g in genes]
            parts.append(f"{key} {np.median(values):.3g} ({min(values):.3g}, {max(values):.3g})")
        lines.append(f"- {name}: " + "; ".join(parts))
    return [*lines, ""]


def tried(trials: Trials, field: str) -> list[str]:
    """Return a table of medians with their intervals, a column a condition."""
    conditions = list(next(iter(trials.values())))
    cells = {
        (name, c): interval(getattr(trials[name][c], field)) for name in trials for c in conditions
    }
    first = {c: min(cells[name, c][0] for name in trials) for c in conditions}
    rows = []
    for name in trials:
        row = [name]
        for c in conditions:
            middle, low, high = cells[name, c]
            text = f"{number(middle)} ({number(low)}, {number(high)})"
            lost = int(np.isinf(getattr(trials[name][c], field)).sum())
            text = f"**{text}**" if middle == first[c] and np.isfinite(middle) else text
            row.append(text + (f"; {lost} div." if lost else ""))
        rows.append(row)
    return table(["controller", *conditions], rows)


def pairs(trials: Trials) -> list[str]:
    """Return ratios of tail errors, run by run; bold where the interval leaves 1 out."""
    conditions = list(next(iter(trials.values())))
    rows = []
    for ours, theirs in PAIRS:
        if ours not in trials or theirs not in trials:
            continue
        row = [f"{ours} / {theirs}"]
        for c in conditions:
            values = ratio(trials[ours][c].error, trials[theirs][c].error)
            middle, low, high = interval(values)
            text = f"{number(middle)} ({number(low)}, {number(high)})"
            row.append(f"**{text}**" if high < 1.0 or low > 1.0 else text)
        rows.append(row)
    return table(["tail error of", *conditions], rows)


def left_out(unfinished: Mapping[str, int]) -> list[str]:
    """Say which searches are not at their end."""
    told = [f"{name} ({n} generations)" if n else name for name, n in unfinished.items()]
    return [f"**Not converged, so left out**: {'; '.join(told)}.", ""] if told else []


def written(
    job: Job, found: Mapping[str, list[Track]], trials: Trials, unfinished: Mapping[str, int]
) -> str:
    """Return the report on an arm; `unfinished`: generations of searches that go on, by family."""
    lines = [
        f"# {job.name}",
        "",
        f"Printed by `benchmarks/baselines.py report {job.name}`. Five seeds, each with {TRAINING} "
        f"training arms of its own and three searches (CMA-ES, {SIZE} candidates a generation, "
        f"until {PATIENCE} generations gain less than {100 * GAIN:g} %, at most {LONGEST}); "
        f"{HELD_OUT} held-out arms; {1e3 * STEP:g} ms. Model errors: payload to {job.payload:g} "
        f"kg, masses 20 %, friction, a push to {job.push:g} N m, a sample of delay. Cost: RMS "
        "error over all joints in the last half, the torque varying by at most "
        f"{1e-3 * job.quiet:g} kN m/s.",
        "",
        f"![Tail errors](baselines-{job.name}.png)",
        "",
        "## The searches",
        "",
        *left_out(unfinished),
        *training(found),
        *nested(found),
        "Parameters, median over seeds (least, most); Ki and Kd as their terms weigh at "
        f"{AT:g} rad/s:",
        "",
        *parameters(found),
        "## Tail RMS error [mrad]",
        "",
        "Median over seeds and arms (95 % interval); the least of a column is bold.",
        "",
        *tried(trials, "error"),
        "## Who is ahead",
        "",
        "Ratio of tail errors, median over seeds and arms (95 % interval); bold where the interval "
        "leaves 1 out: below 1 the first is better.",
        "",
        *pairs(trials),
        "## Cost (33) without what following exactly takes",
        "",
        f"int e^2 + w2 |u - u_d|^2 dt, w2 = {job.w2:g}, u_d keeping the true arm on the reference; "
        "whole run.",
        "",
        *tried(trials, "excess"),
        "## Variation of the torque [kN m/s]",
        "",
        *tried(trials, "variation"),
    ]
    return "\n".join(lines).rstrip() + "\n"
