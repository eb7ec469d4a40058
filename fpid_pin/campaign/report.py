"""A campaign in one page: who holds where, by how much, what it hangs on, and the worst plants."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.campaign import figures, sensitivity_figures
from fpid_pin.campaign.answers import answer
from fpid_pin.campaign.data import METRICS, CampaignData
from fpid_pin.campaign.statistics import (
    Difference,
    best_shares,
    leader,
    paired_difference,
    quantile,
    scored,
    spearman,
    success_rates,
    tornado,
    worst_runs,
)
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import put_text
from fpid_pin.view.document import Link, as_text
from fpid_pin.view.palette import colour
from fpid_pin.view.report import Table, answer_html, figure_html, page_html, section, table_html

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: What leads from a run (its number) and a controller's name to a replay; None: nowhere.
ReplayLink = Callable[[int, str], str | None]

_CAPTIONS = {
    "distributions": "Share of all plants with at most so much; a curve ends at the success rate",
    "violins": "Runs that ended well: distribution, quartiles, median",
    "tornado": "Median error where a parameter is in its lowest and in its highest fifth",
    "scatter": "Every plant; colour: RMS error, cross: lost",
}
_NOTES = {
    "success": (
        "A run succeeds when it ends, in its torque limits or at them, with finite errors. Best: "
        "share of all plants with the least RMS error. Wilson's intervals hold for a number of "
        "runs that was fixed beforehand."
    ),
    "metrics": "Of all plants; inf: so many were lost. 10 % of the plants are worse than p90.",
    "pairs": (
        "First less second on the same plants; less is better. Medians and their bootstrap "
        "intervals are of the plants on which both succeeded; a plant that one of them has lost "
        "counts for the other. Every interval is of 95 % by itself."
    ),
    "sensitivity": (
        "Spearman's rank correlation of a parameter with the RMS error, with its 95 % interval, "
        "and the median error in its lowest and highest fifth; lost runs count as the worst."
    ),
    "worst": "Those that were lost first, in the order of their numbers.",
}  # fmt: skip


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
    marks = {name: colour(k) for k, name in enumerate(data.controllers)}
    differences = _differences(data)
    told = answer(data, differences.get("rms", []))
    parts = [answer_html([*told, f"Dynamics: {data.dynamics}."])]

    def add(heading: str, content: str, note: str) -> None:
        parts.append(section(heading, f"<p>{as_text(_NOTES[note])}</p>{content}"))

    add("Success", table_html(_success(data), marks), "success")
    add("Errors and effort", table_html(_metrics(data), marks), "metrics")
    if differences:
        tables = [_pairs(data, several) for several in differences.values()]
        heads = [as_text(figures.label(metric)) for metric in differences]
        add("Paired differences", _folded(heads, tables, 0, marks), "pairs")
    drawn = "".join(figure_html(_CAPTIONS[name], figure) for name, figure in _figures(data))
    parts.append(section("Figures", f'<div class="figures roomy">{drawn}</div>'))
    first, names = leader(data), [_marked(name, k) for k, name in enumerate(data.controllers)]
    if data.parameters:
        add("Sensitivity", _folded(names, _sensitivities(data), first), "sensitivity")
    lost = [data.runs - int(count) for count in data.success.sum(axis=0)]
    heads = [
        f"{name}: {count} lost" if count else name for name, count in zip(names, lost, strict=True)
    ]
    tables = [_worst(data, k, replay_link) for k in range(len(names))]
    add("The ten worst runs", _folded(heads, tables, first), "worst")
    return put_text(path, page_html(data.title or "Campaign", parts))


def _differences(data: CampaignData) -> dict[str, list[Difference]]:
    count = len(data.controllers)
    pairs = [(a, b) for a in range(count) for b in range(a + 1, count)]
    if not pairs:
        return {}
    return {
        name: [paired_difference(data, *pair, name) for pair in pairs] for name in figures.SHOWN
    }


def _success(data: CampaignData) -> Table:
    best, rates = best_shares(data), success_rates(data)
    rows: list[dict[str, object]] = []
    for k, name in enumerate(data.controllers):
        ends = data.outcome[:, k]
        rows.append({
            "controller": name,
            "success, %": 100.0 * rates[k].estimate,
            "from, %": 100.0 * rates[k].low,
            "to, %": 100.0 * rates[k].high,
            "best, %": 100.0 * float(best[k]),
            "saturated": int((ends == "saturated").sum()),
            "diverged": int((ends == "diverged").sum()),
            "failed": int((ends == "failed").sum()),
        })  # fmt: skip
    return rows


def _metrics(data: CampaignData) -> Table:
    rows: list[dict[str, object]] = []
    for k, name in enumerate(data.controllers):
        row: dict[str, object] = {"controller": name}
        for metric in data.metrics:
            unit = METRICS.get(metric, "").replace("^2", "²")
            head, scores = metric.replace("_", " "), scored(data, metric)[:, k]
            row[f"{head}, median, {unit}"] = quantile(scores, 0.5)
            row[f"{head}, p90, {unit}"] = quantile(scores, 0.9)
        rows.append(row)
    return rows


def _pairs(data: CampaignData, several: list[Difference]) -> Table:
    return [
        {
            "first": data.controllers[found.first],
            "second": data.controllers[found.second],
            "median": found.median.estimate,
            "from": found.median.low,
            "to": found.median.high,
            "plants": found.runs,
            "first better, %": 100.0 * found.better.estimate,
            "from, %": 100.0 * found.better.low,
            "to, %": 100.0 * found.better.high,
            "of plants": found.differing,
        }
        for found in several
    ]


def _sensitivities(data: CampaignData) -> list[Table]:
    rho, ends = spearman(data), tornado(data)
    order = np.argsort(-np.nan_to_num(np.abs(rho[..., 0]), nan=-1.0), axis=1, kind="stable")
    return [
        [
            {
                "parameter": data.parameters[j],
                "correlation": float(rho[k, j, 0]),
                "from": float(rho[k, j, 1]),
                "to": float(rho[k, j, 2]),
                "median error where small, rad": float(ends[k, j, 0]),
                "where large, rad": float(ends[k, j, 1]),
            }
            for j in order[k]
        ]
        for k in range(len(data.controllers))
    ]


def _figures(data: CampaignData) -> Iterator[tuple[str, Figure]]:
    yield "distributions", figures.distributions(data)
    yield "violins", figures.violins(data)
    if (sensitivity_figures.effects(tornado(data)) >= 0.0).any():
        yield "tornado", sensitivity_figures.tornado_plot(data)
    pair = sensitivity_figures.two_that_matter(data)
    if pair is not None:
        yield "scatter", sensitivity_figures.scatter(data, *pair)


def _worst(data: CampaignData, controller: int, replay_link: ReplayLink | None) -> Table:
    errors, name = scored(data)[:, controller], data.controllers[controller]
    rows: list[dict[str, object]] = []
    for run in worst_runs(data, controller):
        row: dict[str, object] = {"run": run}
        if replay_link is not None:
            href = replay_link(run, name)
            row["replay"] = "" if href is None else Link("replay", href)
        ended = str(data.outcome[run, controller])
        row |= {"outcome": ended, "RMS error, rad": float(errors[run])}
        named = zip(data.parameters, data.units, data.samples[run], strict=True)
        row |= {f"{label}, {unit}" if unit else label: float(x) for label, unit, x in named}
        rows.append(row | {"cause": str(data.cause[run, controller])})
    return rows


def _marked(name: str, k: int) -> str:
    return f'<i class="swatch" style="background: {colour(k)}"></i>{as_text(name)}'


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
