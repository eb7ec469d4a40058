"""Tables and picture for `baselines.py`: medians with intervals, who is ahead, what failed.

An interval is scipy's bootstrap (percentiles, 95 %) of the median over seeds and arms, both drawn
anew: with five seeds it says how much hangs on them, too.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from common import table
from contestants import AT, FAMILIES
from converging import GAIN, LONGEST, PATIENCE, SIZE, Track
from protocol import HELD_OUT, STEP, TRAINING, Job

Trials = Mapping[str, Mapping[str, "Trial"]]
RESAMPLES = 2000

#: Whose ratios are shown: what fractional orders, adaptation and the model are worth, and how the
#: FPID with its model stands beside every rival.
PAIRS = (
    ("FPID", "PID"), ("adaptive FPID", "adaptive PID"), ("FPID + model", "PID + model"),
    ("adaptive FPID + model", "adaptive PID + model"), ("adaptive PID", "PID"),
    ("adaptive FPID", "FPID"), ("adaptive PID + model", "PID + model"),
    ("adaptive FPID + model", "FPID + model"), ("FPID + model", "computed torque + I + observer"),
    *(("adaptive FPID + model", other) for other in (
        "adaptive FPID", "PID + G + observer", "computed torque + I + observer",
        "sliding mode + observer", "Slotine-Li",
    )),
)  # fmt: skip


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


def shown(cell: tuple[float, float, float], bold: bool) -> str:
    """Return a median and its interval as text."""
    middle, low, high = (f"{x:.3g}" if np.isfinite(x) else "div." for x in cell)
    text = f"{middle} ({low}, {high})"
    return f"**{text}**" if bold else text


def spread(values: Sequence[float]) -> str:
    """Return median, least and most."""
    return f"{np.median(values):.3g} ({min(values):.3g}, {max(values):.3g})"


def ratio(ours: np.ndarray, theirs: np.ndarray) -> np.ndarray:
    """Return ours/theirs, run by run: 0 where only they diverged, inf where only we, 1 for both."""
    with np.errstate(invalid="ignore"):
        return np.where(np.isinf(ours) & np.isinf(theirs), 1.0, ours / theirs)


def best_of(tracks: list[Track], seed: int) -> Track:
    """Return the search that found most for a seed."""
    return min((t for t in tracks if t.seed == seed), key=lambda t: t.best)


def best(tracks: list[Track], label: str = "") -> np.ndarray:
    """Return the lowest cost of each seed [mrad], of all searches or of those so labelled."""
    seeds = sorted({t.seed for t in tracks})
    chosen = [[t.best for t in tracks if t.seed == s and label in t.label] for s in seeds]
    return 1e3 * np.array([min(costs) for costs in chosen])


def training(found: Mapping[str, list[Track]]) -> list[str]:
    """Return what the searches came to, and how far they still moved at the end."""
    head = ["controller", "numbers", "cost [mrad]: median (least, most)", "candidates a search",
            "cost at half of them", "worst of three searches / best", "cut short"]  # fmt: skip
    rows = []
    for name, tracks in found.items():
        costs = best(tracks)
        half = [t.history[(len(t.history) - 1) // 2] / t.best for t in tracks]
        seeds = sorted({t.seed for t in tracks})
        each = [[t.best for t in tracks if t.seed == seed] for seed in seeds]
        apart = [max(found) / min(found) for found in each]
        at = [f"x {np.median(x):.3f} (worst {max(x):.2f})" for x in (half, apart)]
        sizes = [SIZE * len(t.history) for t in tracks]
        cut = sum(len(t.history) >= LONGEST for t in tracks)
        rows.append([
            name, len(FAMILIES[name].space), spread(costs), f"{min(sizes)} to {max(sizes)}", *at,
            f"{cut} of {len(tracks)}",
        ])  # fmt: skip
    return table(head, rows)


def nested(found: Mapping[str, list[Track]]) -> list[str]:
    """Say of every family that contains another whether its searches knew."""
    lines = []
    for name, tracks in found.items():
        for part in set(FAMILIES[name].contains) & set(found):
            own, alone, less = best(tracks), best(tracks, "alone"), best(found[part])
            text = f"- {name} contains {part}: its cost is {spread(own / less)} of that one's"
            if (own > less * (1.0 + 1e-9)).any():
                text += "; **worse somewhere: the optimiser failed**"
            failed = int((alone > less * (1.0 + 1e-9)).sum())
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
        family = FAMILIES[name]
        genes = [family.genes(best_of(tracks, seed).point) for seed in {t.seed for t in tracks}]
        told = (f"{key} {spread([g[key] for g in genes])}" for key in family.space)
        lines.append(f"- {name}: " + "; ".join(told))
    return [*lines, ""]


def tried(trials: Trials, field: str) -> list[str]:
    """Return a table of medians with their intervals, a column a condition."""
    conditions = list(next(iter(trials.values())))
    rows = [[name] for name in trials]
    for c in conditions:
        cells = [interval(getattr(trial[c], field)) for trial in trials.values()]
        first = min(middle for middle, _, _ in cells)
        for row, trial, cell in zip(rows, trials.values(), cells, strict=True):
            text = shown(cell, bold=cell[0] == first and np.isfinite(first))
            lost = int(np.isinf(getattr(trial[c], field)).sum())
            row.append(text + (f"; {lost} div." if lost else ""))
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
            cell = interval(ratio(trials[ours][c].error, trials[theirs][c].error))
            row.append(shown(cell, bold=cell[2] < 1.0 or cell[1] > 1.0))
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


#: One colour a kind: PIDs and FPIDs without the model, with it, and the others.
KINDS = {
    "PID without a model": "tab:blue",
    "PID with feedforward and observer": "tab:orange",
    "the usual laws with a model": "0.35",
}
COLUMNS = 3
FAR = 20.0  # what lies beyond is an arrow [mrad]


def kind(name: str) -> str:
    """Return which of `KINDS` a family is."""
    if "+ model" in name:
        return "PID with feedforward and observer"
    return "PID without a model" if name.endswith("PID") else "the usual laws with a model"


def draw(trials: Trials, path: Path, title: str) -> None:
    """Draw tail errors, a panel a condition: medians, intervals, arrows where these go on."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    conditions = list(next(iter(trials.values())))
    names = sorted(trials, key=lambda name: list(KINDS).index(kind(name)))
    rows = -(-len(conditions) // COLUMNS)
    figure, axes = plt.subplots(
        rows, COLUMNS, figsize=(12.0, 1.2 + 2.7 * rows), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    place = np.arange(len(names))[::-1]
    found = {(n, c): interval(trials[n][c].error) for n in names for c in conditions}
    left = 0.4 * min(x[0] for x in found.values())
    for axis, condition in zip(axes.flat, conditions, strict=False):
        for y, name in zip(place, names, strict=True):
            middle, low, high = found[name, condition]
            colour = KINDS[kind(name)]
            if not np.isfinite(middle):
                axis.text(0.98, y, "diverged", ha="right", va="center", fontsize=8, color=colour,
                          transform=axis.get_yaxis_transform())  # fmt: skip
                continue
            axis.plot([np.clip(low, left, FAR), min(high, FAR)], [y, y], color=colour, lw=1.6)
            if high > FAR:
                axis.plot(FAR, y, ">", color=colour, ms=5, clip_on=False)
            axis.plot(middle, y, "o", color=colour, mfc=colour if "FPID" in name else "w", ms=6)
        axis.set(xscale="log", xlim=(left, FAR), xlabel="tail RMS error [mrad]")
        axis.set_title(condition, fontsize=10)
        axis.set_yticks(place, names, fontsize=8)
        axis.grid(axis="x", which="both", color="0.9", lw=0.6)
        axis.label_outer()
    for axis in axes.flat[len(conditions) :]:
        axis.set_visible(False)
    styles = [{"color": colour, "lw": 1.6, "label": name} for name, colour in KINDS.items()]
    styles += [{"color": "0.2", "mfc": "0.2", "ls": "", "label": "fractional"},
               {"color": "0.2", "mfc": "white", "ls": "", "label": "integer"}]  # fmt: skip
    marks = [plt.Line2D([], [], marker="o", **style) for style in styles]
    figure.legend(handles=marks, loc="outside lower center", ncols=5, frameon=False)
    figure.suptitle(f"{title}: median over five seeds and their arms, 95 % interval", fontsize=11)
    figure.savefig(path, dpi=110)
    plt.close(figure)
