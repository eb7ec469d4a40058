"""What a campaign says, in sentences."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.statistics import (
    Difference,
    Interval,
    leader,
    quantile,
    scored,
    success_rates,
)


def answer(data: CampaignData, differences: Sequence[Difference]) -> list[str]:
    """Return what a campaign says, in lines, the most important first.

    Parameters
    ----------
    data
        At least one run.
    differences
        Of pairs of controllers, in their RMS errors; those with the leader are told.
    """
    first = leader(data)
    rates, names = success_rates(data), data.controllers
    of = f"of {data.runs} plant{'s' * (data.runs != 1)} (95 %: {_percent(rates[first])} %)"
    typical = quantile(scored(data)[:, first], 0.5)
    if not data.success.any():
        return [f"No controller succeeded on any {of}."]
    lines = [f"{names[first]} succeeded on {100.0 * rates[first].estimate:.4g} % {of}."]
    if np.isfinite(typical):
        lines.append(f"Its RMS error is {typical:.3g} rad or less on half of the plants.")
    for found in differences:
        if first in (found.first, found.second):
            lines.append(_compared(data, found, first))
    lines.append(f"{data.runs} runs, every controller on the same plants; seed {data.seed}.")
    return lines


def _compared(data: CampaignData, found: Difference, first: int) -> str:
    sign = 1.0 if found.first == first else -1.0
    other = data.controllers[found.second if found.first == first else found.first]
    if found.differing == 0:
        return f"Against {other}: no plant on which either is better."
    ends = (found.better.low, found.better.high)
    share, low, high = (found.better.estimate, *ends) if sign > 0.0 else (
        1.0 - found.better.estimate, 1.0 - ends[1], 1.0 - ends[0])  # fmt: skip
    text = (
        f"Against {other}: the smaller error on {100.0 * share:.3g} % of {found.differing} plants"
    )
    if low <= 0.5 <= high:
        text += ", which does not tell them apart"
    if np.isnan(found.median.estimate):
        return text + "; no plant on which both succeeded."
    text += f"; where both succeed, {sign * found.median.estimate:+.3g} rad in the median"
    if np.isnan(found.median.low):
        return text + " (too few for an interval)."
    low, high = sorted((sign * found.median.low, sign * found.median.high))
    return text + f" (95 %: {low:+.3g} to {high:+.3g})."


def _percent(interval: Interval) -> str:
    return f"{100.0 * interval.low:.4g} to {100.0 * interval.high:.4g}"
