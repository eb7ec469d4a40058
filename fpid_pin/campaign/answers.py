"""What a campaign says, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.statistics import Difference, leader, quantile, scored, success_rates


def answer(data: CampaignData, differences: Sequence[Difference]) -> list[str]:
    """Return what a campaign says, in lines, the most important first.

    `differences` are those of all pairs in their RMS errors, as `comparisons` has them.
    """
    first = leader(data)
    rate, names = success_rates(data)[first], data.controllers
    ends = f"{100.0 * rate.low:.4g} to {100.0 * rate.high:.4g}"
    of = f"of {data.runs} plant{'s' * (data.runs != 1)} (95 %: {ends} %)"
    typical = quantile(scored(data)[:, first], 0.5)
    if not data.success.any():
        return [f"No controller succeeded on any {of}."]
    lines = [f"{names[first]} succeeded on {100.0 * rate.estimate:.4g} % {of}."]
    if np.isfinite(typical):
        lines.append(f"Its RMS error is {typical:.3g} rad or less on half of the plants.")
    lines += [_compared(names[d.second], d) for d in differences if d.first == first]
    lines.append(f"{data.runs} runs, every controller on the same plants; seed {data.seed}.")
    return lines


def _compared(other: str, found: Difference) -> str:
    """Say how the first of a pair is against the `other`."""
    better, median = found.better, found.median
    if found.differing == 0:
        return f"Against {other}: no plant on which either is better."
    share = f"{100.0 * better.estimate:.3g} % of {found.differing} plants"
    text = f"Against {other}: the smaller error on {share}"
    if better.low <= 0.5 <= better.high:
        text += ", which does not tell them apart"
    if np.isnan(median.estimate):
        return text + "; no plant on which both succeeded."
    text += f"; where both succeed, {median.estimate:+.3g} rad in the median"
    if np.isnan(median.low):
        return text + " (too few for an interval)."
    return text + f" (95 %: {median.low:+.3g} to {median.high:+.3g})."
