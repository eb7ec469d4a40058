"""What a campaign's runs say, and how surely: rates, paired differences, sensitivities.

A run that was lost (diverged, failed) has no error; here it counts as one worse than any number,
infinity, so that no controller gains by losing the plants that are hard. Intervals are of 95 %,
each by itself, for a number of runs that was fixed beforehand.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.simulation.comparison import MEASURES, TIE, change, standing
from fpid_pin.text import enumerated, head_for

if TYPE_CHECKING:
    from fpid_pin.campaign.data import CampaignData

#: What decides: the RMS error of the last half.
DECIDES = "rms_tail"
CONFIDENCE = 0.95
#: Fewer differences have no bootstrap interval: resampled, so few say little about the rest.
FEWEST = 20
RESAMPLES = 999
# Numbers drawn at once by the bootstrap.
_BATCH = 2_000_000
# Share of the runs at either end of a parameter that a tornado compares.
_QUINTILE = 0.2


class Interval(NamedTuple):
    """An estimate and the ends of its interval; NaN where there are too few runs for one."""

    estimate: float
    low: float
    high: float


def wilson(successes: int, runs: int) -> Interval:
    """Return the share of successes with its score interval (Wilson 1927), by SciPy."""
    from scipy.stats import binomtest

    if runs == 0:
        return Interval(float("nan"), 0.0, 1.0)
    found = binomtest(successes, runs).proportion_ci(CONFIDENCE, "wilson")
    return Interval(successes / runs, float(found.low), float(found.high))


def success_rates(data: CampaignData) -> list[Interval]:
    """Return the share of plants on which each controller succeeded."""
    return [wilson(int(count), data.runs) for count in data.success.sum(axis=0)]


def scored(data: CampaignData, metric: str = DECIDES) -> FloatArray:
    """Return a metric with infinity where a run was lost, (runs, controllers)."""
    values = data.metrics[metric]
    return np.where(data.ended & ~np.isnan(values), values, np.inf)


def quantile(scores: FloatArray, share: float) -> FloatArray:
    """Return the least value that so large a share of the runs does not exceed; inf where lost.

    Of scores (runs,) or (runs, controllers): NaN where there are no runs.
    """
    if len(scores) == 0:
        return np.full(scores.shape[1:], np.nan)
    return np.asarray(np.quantile(scores, share, axis=0, method="inverted_cdf"))


@dataclass(frozen=True)
class Difference:
    """One controller against another, on the same plants."""

    first: int  # their columns
    second: int
    runs: int  # plants on which both came to their end
    #: Of the first one's metric less the second one's over these, in the metric's unit, with its
    #: bootstrap interval (percentiles of `RESAMPLES` resamples).
    median: Interval
    differing: int  # plants on which either was better: not the same bits, and not both lost
    better: Interval  # share of those on which the first was, with its score interval


def paired_difference(
    data: CampaignData, first: int, second: int, metric: str = DECIDES
) -> Difference:
    """Return how two controllers, by column, differ on the same plants.

    The median, as a few plants that are nearly lost would rule a mean.
    """
    scores = scored(data, metric)
    a, b = scores[:, first], scores[:, second]
    both = np.isfinite(a) & np.isfinite(b)
    wins, losses = int((a < b).sum()), int((a > b).sum())
    median = bootstrap_median(a[both] - b[both], data.seed)
    return Difference(
        first, second, int(both.sum()), median, wins + losses, wilson(wins, wins + losses)
    )


def comparisons(data: CampaignData, metric: str = DECIDES) -> list[Difference]:
    """Return how all pairs of controllers differ; the leader is the first one of its pairs."""
    first = leader(data)
    order = sorted(range(len(data.controllers)), key=lambda k: k != first)
    return [paired_difference(data, *pair, metric) for pair in combinations(order, 2)]


def bootstrap_median(values: FloatArray, seed: int = 0) -> Interval:
    """Return a median with its bootstrap interval; the same seed, the same ends."""
    from scipy.stats import bootstrap

    nan = float("nan")
    estimate = float(np.median(values)) if len(values) else nan
    if len(values) < FEWEST:
        return Interval(estimate, nan, nan)
    found = bootstrap(
        (values,), np.median, confidence_level=CONFIDENCE, n_resamples=RESAMPLES,
        method="percentile", batch=max(_BATCH // len(values), 1), vectorized=True,
        random_state=np.random.default_rng(seed),
    ).confidence_interval  # fmt: skip
    return Interval(estimate, float(found.low), float(found.high))


def spearman(data: CampaignData) -> FloatArray:
    """Return Spearman's rho of the error and each uncertain number, (controllers, parameters, 3).

    Behind it the ends of its interval, by Fisher's z with the variance (1 + rho^2/2)/(n - 3) of
    Bonett and Wright (2000). Lost runs share the last rank; NaN where there is nothing to rank.
    """
    from scipy.special import ndtri
    from scipy.stats import rankdata

    scores = scored(data)
    controllers = scores.shape[1]
    rho = np.full((controllers, len(data.parameters)), np.nan)
    # Constants, fewer runs; arctanh(1) is infinite.
    with np.errstate(divide="ignore", invalid="ignore"):
        if data.runs > 3:
            ranks = rankdata(np.hstack([scores, data.samples]), axis=0)
            rho = np.atleast_2d(np.corrcoef(ranks, rowvar=False))[:controllers, controllers:]
        width = ndtri(0.5 + CONFIDENCE / 2.0) * np.sqrt((1.0 + rho**2 / 2.0) / (data.runs - 3))
        ends = [np.tanh(np.arctanh(rho) + sign * width) for sign in (-1.0, 1.0)]
    return np.stack([rho, *ends], axis=-1)


def tornado(data: CampaignData) -> FloatArray:
    """Return medians over the runs in each uncertain number's lowest and highest quintile.

    (controllers, parameters, 2), ties included; infinity where most of them were lost, NaN where
    the number is the same in all runs.
    """
    scores = scored(data)
    found = np.full((len(data.controllers), len(data.parameters), 2), np.nan)
    for k, values in enumerate(data.samples.T):
        if len(values) == 0 or values.min() == values.max():
            continue
        low, high = (s * quantile(s * values, _QUINTILE) for s in (1.0, -1.0))
        ends = values <= low, values >= high
        if low >= high:
            # One value fills both quintiles: it is compared with what lies beside it.
            below, above = values < low, values > low
            ends = below if below.any() else ~above, above if above.any() else ~below
        for end, rows in enumerate(ends):
            found[:, k, end] = quantile(scores[rows], 0.5)
    return found


def best_shares(data: CampaignData) -> FloatArray:
    """Return the share of the plants on which each controller has the least error.

    Those that are equal to the last bit divide a plant; nobody has one that all have lost, so that
    the shares may sum to less than one. (controllers,)
    """
    scores = scored(data)
    winners = np.isfinite(scores) & (scores == scores.min(axis=1, keepdims=True))
    shares = winners / np.maximum(winners.sum(axis=1, keepdims=True), 1)
    return np.asarray(shares.sum(axis=0) / max(data.runs, 1))


def leader(data: CampaignData) -> int:
    """Return the controller with most successes; among equals, that of the least median error."""
    order = np.lexsort((quantile(scored(data), 0.5), -data.success.sum(axis=0)))
    return int(order[0])


def worst_runs(data: CampaignData, controller: int) -> list[int]:
    """Return a controller's ten worst runs: first those that were lost, then by falling error."""
    order = np.argsort(-scored(data)[:, controller], kind="stable")
    return [int(run) for run in order[:10]]


def answer(data: CampaignData) -> list[str]:
    """Return what a campaign says, in lines, the most important first."""
    if data.runs == 0:
        return ["No runs."]
    plants = f"{data.runs} plant{'s' * (data.runs != 1)}"
    if not data.ended.any():
        return [f"Nobody is best: all runs were lost, on {plants}."]
    first, names = leader(data), data.controllers
    others = [k for k in range(len(names)) if k != first]
    several = {k: paired_difference(data, first, k) for k in others}
    scores, rates = scored(data), success_rates(data)
    middle = quantile(scores, 0.5)
    tail = MEASURES["tail"]
    tail = replace(tail, head=head_for(tail.head, data.angles))
    write = [tail.write(1e3 * float(x)) for x in middle]
    if not np.isfinite(middle[first]):
        lines = [f"Nobody is best: {names[first]}, of most successes, was lost on half the plants."]
    else:
        order = [int(k) for k in np.argsort(middle, kind="stable") if k != first]
        ties = [k for k in order if _ties(several[k], middle[first], rates)]
        rest = [k for k in order if k not in ties]
        rivals = list(dict.fromkeys([*rest[:2], *(k for k in rest if k == 0)]))
        write[first] += _median_ends(scores[:, first])
        lost = "was lost on half the plants"
        told = standing(names, middle, write, [first, *ties], rivals, lost)
        varies = quantile(scored(data, "total_variation"), 0.5)
        costs = [change(varies[first], varies[k], names[k]) for k in [*ties, *rest][:2]
                 if np.isfinite(varies[k])]  # fmt: skip
        lines = [
            f"Best, by its median RMS error of the last half: {told}."
            + (f" Its torque varies {enumerated(costs)}." if costs else "")
        ]
    shares = sorted(range(len(names)), key=lambda k: (k != first, -rates[k].estimate))
    well = [f"{names[k]} {100.0 * rates[k].estimate:.4g} %" for k in shares]
    well[0] += _ends(rates[first].low, rates[first].high, 100.0)
    words = data.criterion.words(data.angles)
    lines.append(f"Success{f' ({words})' * bool(words)}: {', '.join(well)}.")
    lines += [_compared(names[k], found, tail.unit) for k, found in several.items()]
    return [*lines, f"{plants}, every controller on the same; seed {data.seed}."]


def _ties(found: Difference, middle: float, rates: list[Interval]) -> bool:
    """Return whether a pair's errors and successes do not tell them apart."""
    one, two = rates[found.first], rates[found.second]
    near = abs(found.median.estimate) <= TIE * middle
    covers = found.median.low <= 0.0 <= found.median.high
    return (near or covers) and one.low <= two.high and two.low <= one.high


def _median_ends(scores: FloatArray) -> str:
    """Return the interval of a median in brackets, by order statistics [mrad]."""
    from scipy.stats import quantile_test

    if len(scores) < FEWEST:
        return ""
    found = quantile_test(scores, p=0.5).confidence_interval(CONFIDENCE)
    return _ends(float(found.low), float(found.high), 1e3)


def _ends(low: float, high: float, factor: float) -> str:
    """Return the ends of an interval in brackets."""
    return f" (95 %: {factor * low:.4g} to {factor * high:.4g})"


def _compared(other: str, found: Difference, unit: str) -> str:
    """Say how the first of a pair is against the `other`; errors times 1,000 have this unit."""
    better, median = found.better, found.median
    if found.differing == 0:
        return f"Against {other}: no plant on which either is better."
    share = f"{100.0 * better.estimate:.3g} % of {found.differing} plants"
    text = f"Against {other}: the smaller error on {share}"
    if better.low <= 0.5 <= better.high:
        text += ", which does not tell them apart"
    if np.isnan(median.estimate):
        return text + "; no plant on which both came to their end."
    text += f"; where both did, {1e3 * median.estimate:+.3g} {unit} in the median"
    if np.isnan(median.low):
        return text + " (too few for an interval)."
    return text + f" (95 %: {1e3 * median.low:+.3g} to {1e3 * median.high:+.3g})."
