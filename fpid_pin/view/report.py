"""A report: replay, figures, tables and configuration in one file that opens anywhere."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.costs import Metrics
from fpid_pin.files import replacing
from fpid_pin.simulation.run import Run
from fpid_pin.view.document import as_text, asset, document
from fpid_pin.view.export import as_runs, replay_html
from fpid_pin.view.panels import names_of
from fpid_pin.view.paper_figures import figures as standard_figures
from fpid_pin.view.scene import captions_of
from fpid_pin.view.style import INK, figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: A table: either its heading row and its rows, or one mapping a row from heading to cell;
#: numbers are set to four significant digits.
Table = Sequence[Sequence[object]] | Sequence[Mapping[str, object]]

# What a configuration's text is laid out by.
_LINES = "\n\t"
#: More arms than these side by side cannot be told apart on a screen.
MOST_IN_REPLAY = 6

_UNITS = {
    "ise": "rad² s", "iae": "rad s", "itae": "rad s²", "rms": "rad", "rms_tail": "rad",
    "energy": "(N m)² s", "total_variation": "N m", "peak_torque": "N m",
    "peak_error": "rad", "settling_time": "s", "overshoot": "rad", "saturated": "share of time",
    "torque_rate": "N m/s",
}  # fmt: skip
_CAPTIONS = {
    "fig4": "Integer orders: tracking, control signals, errors (the paper's Fig. 4)",
    "fig5": "Fractional orders: tracking, control signals, errors (the paper's Fig. 5)",
    "gains": "Adapted gains, and orders where they move",
    "lyapunov": "The supervisor's Lyapunov function and torque",
    "comparison": "Errors and torques compared",
}


def report_html(
    path: str | Path,
    runs: Run | Sequence[Run],
    *,
    title: str,
    tables: Mapping[str, Table] | None = None,
    figures: Mapping[str, Figure] | None = None,
    config_text: str = "",
    embed_replay: bool = True,
    captions: Sequence[str] | None = None,
) -> Path:
    """Write a report as one self-contained page, light or dark as its reader's system is.

    Parameters
    ----------
    path
        The file; it appears whole or not at all.
    runs
        What was run; at least one.
    title
        Plain text.
    tables
        By heading: rows of cells, the first row being the columns' names, or one mapping a row.
        None: the metrics of the runs, by joint.
    figures
        By caption, or by a name that `figures` gives. None: those.
    config_text
        The configuration, as it was read.
    embed_replay
        Whether the replay is part of the page; it shows the first six runs.
    captions
        One a run; None: their names.

    Returns
    -------
    Path

    Raises
    ------
    ArgumentError
        No runs, or not one caption a run.
    FileFormatError
        The file cannot be written.
    """
    several = as_runs(runs)
    names = captions_of(several, captions)
    drawn = standard_figures(several) if figures is None else figures
    shown = {"Figures of merit": metrics_table(several, names)} if tables is None else tables
    parts, replay = [_outcomes(several, names)], ""
    if embed_replay:
        first = slice(MOST_IN_REPLAY)
        replay = replay_html(several[first], captions=names[first], title=title)
        heading = "Replay"
        if len(several) > MOST_IN_REPLAY:
            heading += f" of the first {MOST_IN_REPLAY} runs"
        parts.append(_section(heading, f'<iframe title="replay" sandbox="allow-scripts" '
                              f'srcdoc="{escape(replay)}"></iframe>'))  # fmt: skip
    parts += [_section(heading, _table(rows)) for heading, rows in shown.items()]
    if drawn:
        cells = "".join(_figure(name, figure) for name, figure in drawn.items())
        parts.append(_section("Figures", f'<div class="figures">{cells}</div>'))
    if config_text:
        parts.append(_section("Configuration", f"<pre>{as_text(config_text, keep=_LINES)}</pre>"))
    parts.append(_section("Versions", _table(_versions(several, names))))
    text = _page(title, parts, replay)
    path = Path(path)
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return path


def metrics_table(runs: Sequence[Run], captions: Sequence[str]) -> Table:
    """Return the figures of merit of runs: a row for each run and joint."""
    names = [field.name for field in fields(Metrics)]
    head = ["run", "joint", *(f"{name.replace('_', ' ')}, {_UNITS[name]}" for name in names)]
    rows: list[list[object]] = [list(head)]
    for run, caption in zip(runs, captions, strict=True):
        for j, joint in enumerate(names_of(run)):
            rows.append([caption, joint, *(getattr(run.metrics, name)[j] for name in names)])
    return rows


def _versions(runs: Sequence[Run], captions: Sequence[str]) -> Table:
    keys = sorted({key for run in runs for key in run.meta.get("versions", {})})
    head: list[object] = ["run", *keys, "seed", "platform"]
    rows = [
        [caption, *(run.meta.get("versions", {}).get(key, "") for key in keys),
         str(run.meta.get("seed", "")), run.meta.get("platform", "")]
        for run, caption in zip(runs, captions, strict=True)
    ]  # fmt: skip
    return [head, *rows]


def _cell(value: object) -> str:
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    return as_text(str(value))


def _rows(table: Table) -> list[list[object]]:
    """Return a table as its heading row and its rows."""
    heads: dict[str, None] = {}
    for row in table:
        if isinstance(row, Mapping):
            heads |= dict.fromkeys(row)
    if not heads:
        return [list(row) for row in table]
    filled = [[row.get(head, "") for head in heads] for row in table if isinstance(row, Mapping)]
    return [list(heads), *filled]


def _table(table: Table) -> str:
    rows = _rows(table)
    if not rows:
        return ""
    head = "".join(f"<th>{_cell(cell)}</th>" for cell in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{_cell(cell)}</td>" for cell in row) + "</tr>" for row in rows[1:]
    )
    element = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return f'<div class="wide" tabindex="0">{element}</div>'


def _figure(name: str, figure: Figure) -> str:
    what, _, of = name.partition("-")
    caption = _CAPTIONS.get(what, name)
    if of and what in _CAPTIONS:
        caption = f"{caption}: {of}"
    width, height = figure.get_size_inches()
    kind = ' class="broad"' if width > 8.0 and width > 1.3 * height else ""
    svg = inline_svg(figure, name)
    return f"<figure{kind}>{svg}<figcaption>{as_text(caption)}</figcaption></figure>"


def inline_svg(figure: Figure, name: str) -> str:
    """Return a figure as an SVG element whose ink and paper are those of the page around it."""
    text = figure_bytes(figure, "svg").decode("utf-8")
    text = text[text.index("<svg") :]
    text = text.replace(INK, "currentColor").replace("fill: #ffffff", "fill: none")
    # Ids must differ between figures of one page; references to them are all of these forms.
    prefix = re.sub(r"[^a-zA-Z0-9]", "-", name) + "-"
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    text = re.sub(r'href="#', f'href="#{prefix}', text)
    text = text.replace("url(#", f"url(#{prefix}")
    return text.replace("<svg ", f'<svg role="img" aria-label="{as_text(name)}" ', 1)


def _outcomes(runs: Sequence[Run], captions: Sequence[str]) -> str:
    return "".join(
        f'<p class="{"about" if run.outcome.completed else "ended"}">'
        f"{as_text(caption)}: {as_text(str(run.outcome))}</p>"
        for run, caption in zip(runs, captions, strict=True)
    )


def _anchor(heading: str) -> str:
    return re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "section"


def _section(heading: str, content: str) -> str:
    return f'<section id="{_anchor(heading)}"><h2>{as_text(heading)}</h2>{content}</section>'


def _page(title: str, parts: Sequence[str], replay: str) -> str:
    links = "".join(
        f'<a href="#{anchor}">{heading}</a>'
        for part in parts
        for anchor, heading in re.findall(r'^<section id="([^"]*)"><h2>(.*?)</h2>', part)
    )
    head = f"<main><h1>{as_text(title)}</h1>{parts[0]}<nav>{links}</nav>"
    return document(
        title,
        style=asset("report.css"),
        body=f"{head}{''.join(parts[1:])}</main>",
        embedded=replay,
    )
