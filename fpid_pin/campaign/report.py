"""A campaign in one page: who holds where, by how much, what it hangs on, and the worst plants."""

from collections.abc import Callable, Mapping, Sequence
from itertools import starmap
from pathlib import Path

import numpy as np

from fpid_pin.campaign import figures, statistics
from fpid_pin.campaign.data import OUTCOMES, CampaignData
from fpid_pin.checks import FloatArray, checked
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import put_text
from fpid_pin.view.document import Link, as_text
from fpid_pin.view.report import Table, answer_html, figure_html, page_html, section, table_html
from fpid_pin.view.style import colour

#: What leads from a run (its number) and a controller's name to a replay; None: nowhere.
ReplayLink = Callable[[int, str], str | None]

# Behind the head of what is a share.
_PERCENT = ", %"

_NOTES = {
    "Success": (
        "By the campaign's criterion, which the answer has. Best: share of all plants with the "
        "least RMS error of the last half. Wilson's intervals hold for a number of "
        "runs that was fixed beforehand."
    ),
    "Errors and effort": (
        "Of all plants; inf: so many were lost. 10 % of the plants are worse than p90. Over the "
        "joints: errors are root mean squares, energy and variation sums, the peak is the worst "
        "joint's."
    ),
    "Paired differences": (
        "First less second on the same plants; less is better. Medians and their bootstrap "
        "intervals are of the plants on which both came to their end; one that one of them has "
        "lost counts for the other. Every interval is of 95 % by itself."
    ),
    "Sensitivity": (
        "Spearman's rank correlation of a parameter with the RMS error of the last half, with its "
        "95 % interval, and the median error in its lowest and highest fifth; lost runs count as "
        "the worst."
    ),
    "The ten worst runs": "Those that were lost first, in the order of their numbers.",
}


@checked
def report_html(
    data: CampaignData, path: str | Path, *, replay_link: ReplayLink | None = None
) -> Path:
    """Write a campaign's report as one self-contained page.

    Parameters
    ----------
    data
        What the campaign has found, at least one run.
    path
        The file; it appears whole or not at all.
    replay_link
        Given a run and a controller's name, the address of its replay, as the page is to have it:
        relative to the page, quoted as addresses are. None, or where it returns None: no link.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        No runs.
    FileFormatError
        The file cannot be written.
    """
    if data.runs == 0:
        raise ArgumentError("data", "at least one run", "none")
    several = range(len(data.controllers))
    marks = {name: colour(k) for k, name in enumerate(data.controllers)}
    differences = {name: statistics.comparisons(data, name) for name in figures.SHOWN}
    parts = [answer_html([*data.answer, f"Dynamics: {data.dynamics}."])]

    def add(heading: str, content: str) -> None:
        parts.append(section(heading, f"<p>{as_text(_NOTES[heading])}</p>{content}"))

    add("Success", table_html(_success(data), marks))
    add("Errors and effort", table_html(_metrics(data), marks))
    if len(several) > 1:
        heads = [as_text(figures.label(data, metric)) for metric in differences]
        tables = [_pairs(data, found) for found in differences.values()]
        add("Paired differences", _folded(heads, tables, 0, marks))
    drawn = "".join(starmap(figure_html, figures.all_of(data).items()))
    parts.append(section("Figures", f'<div class="figures roomy">{drawn}</div>'))
    names = [
        f'<i class="swatch" style="background: {colour(k)}"></i>{as_text(data.controllers[k])}'
        for k in several
    ]
    first, lost = statistics.leader(data), data.runs - data.ended.sum(axis=0)
    if data.parameters:
        found = zip(statistics.spearman(data), statistics.tornado(data), strict=True)
        add("Sensitivity", _folded(names, [_sensitivity(data, *both) for both in found], first))
    heads = [f"{names[k]}: {lost[k]} lost" if lost[k] else names[k] for k in several]
    tables = [_worst(data, k, replay_link) for k in several]
    add("The ten worst runs", _folded(heads, tables, first))
    return put_text(path, page_html(data.title or "Campaign", parts))


def _interval(head: str, found: Sequence[float], unit: str = "") -> dict[str, object]:
    """Return the cells of an estimate and of the ends of its interval."""
    heads = (f"{head}{unit}", f"from{unit}", f"to{unit}")
    factor = 100.0 if unit == _PERCENT else 1.0
    return {name: factor * float(x) for name, x in zip(heads, found, strict=True)}


def _success(data: CampaignData) -> Table:
    best, rates = statistics.best_shares(data), statistics.success_rates(data)
    return [
        {"controller": name}
        | _interval("success", rates[k], _PERCENT)
        | {"best, %": 100.0 * float(best[k])}
        | {end: int((data.outcome[:, k] == end).sum()) for end in OUTCOMES[1:]}
        for k, name in enumerate(data.controllers)
    ]


def _metrics(data: CampaignData) -> Table:
    shares = {"median": 0.5, "p90": 0.9}
    return [
        {"controller": name}
        | {
            f"{metric.replace('_', ' ')}, {what}, {data.unit(metric)}":
                float(statistics.quantile(statistics.scored(data, metric), share)[k])
            for metric in data.metrics
            for what, share in shares.items()
        }
        for k, name in enumerate(data.controllers)
    ]  # fmt: skip


def _pairs(data: CampaignData, several: list[statistics.Difference]) -> Table:
    return [
        {"first": data.controllers[found.first], "second": data.controllers[found.second]}
        | _interval("median", found.median)
        | {"plants": found.runs}
        | _interval("first better", found.better, _PERCENT)
        | {"of plants": found.differing}
        for found in several
    ]


def _sensitivity(data: CampaignData, rho: FloatArray, ends: FloatArray) -> Table:
    """Return a row a parameter, (parameters, 3) and (parameters, 2), what matters most first."""
    heads = [f"{x}, {data.unit('rms')}" for x in ("median error where small", "where large")]
    return [
        {"parameter": data.parameters[j]}
        | _interval("correlation", rho[j])
        | dict(zip(heads, ends[j].tolist(), strict=True))
        for j in np.argsort(-np.nan_to_num(np.abs(rho[:, 0]), nan=-1.0), kind="stable")
    ]


def _worst(data: CampaignData, controller: int, replay_link: ReplayLink | None) -> Table:
    errors, name = statistics.scored(data)[:, controller], data.controllers[controller]
    heads = [
        f"{x}, {unit}" if unit else x for x, unit in zip(data.parameters, data.units, strict=True)
    ]
    rows: list[dict[str, object]] = []
    for run in statistics.worst_runs(data, controller):
        href = None if replay_link is None else replay_link(run, name)
        row: dict[str, object] = {"run": run}
        row |= {} if replay_link is None else {"replay": href and Link("replay", href)}
        row |= {
            "outcome": str(data.outcome[run, controller]),
            f"RMS error of the last half, {data.unit('rms')}": float(errors[run]),
        }
        row |= zip(heads, data.samples[run].tolist(), strict=True)
        rows.append(row | {"cause": str(data.cause[run, controller])})
    return rows


def _folded(
    heads: Sequence[str],
    tables: Sequence[Table],
    first: int,
    marks: Mapping[str, str] | None = None,
) -> str:
    """Return tables under their heads, of HTML, that open by a click; the first one is open."""
    return "".join(
        f"<details{' open' * (k == first)}><summary>{head}</summary>"
        f"{table_html(table, marks)}</details>"
        for k, (head, table) in enumerate(zip(heads, tables, strict=True))
    )
