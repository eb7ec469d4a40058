"""A report: replay, figures, tables and configuration in one file that opens anywhere."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from fpid_pin.checks import checked
from fpid_pin.files import put_text
from fpid_pin.simulation.comparison import Comparison
from fpid_pin.simulation.run import Run
from fpid_pin.view.document import Link, as_text, asset, document, framed
from fpid_pin.view.plots import figures as standard_figures
from fpid_pin.view.replay import replay_html
from fpid_pin.view.style import INK, as_runs, captions_of, colour, figure_bytes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: One mapping a row from heading to cell; numbers are set to four significant digits.
Table = Sequence[Mapping[str, object]]

#: The last column of a table may say which rows are the best, and is called so itself.
_BEST = "best"
#: Columns beyond which a table is set in small type, and cells beyond which it is folded.
_MANY, _LONG = 9, 100
# What a configuration's text is laid out by.
_LINES = "\n\t"
#: More arms than these side by side cannot be told apart on a screen.
MOST_IN_REPLAY = 6

_CAPTIONS = {
    "orders": (
        "Integer and fractional orders side by side (the paper's Figs. 4 and 5). Circle: largest "
        "torque; shaded: the last half. Where law and first gains are the same, fractional terms "
        "have a part in phase with the error, which acts as a larger Kp: the error is smaller. "
        "Gains that adapt make up for most of it, and the torques are much alike."
    ),
    "fig4": "Integer orders: tracking, control signals, errors (the paper's Fig. 4)",
    "fig5": "Fractional orders: tracking, control signals, errors (the paper's Fig. 5)",
    "gains": "Adapted gains, and orders where they move",
    "lyapunov": "The supervisor's Lyapunov function and torque",
    "comparison": "Errors and torques compared",
    "profile": "The cost along each parameter, all others held; dotted: tuned",
    "ranking": "Every controller under every condition",
}


@checked
def report_html(
    runs: Run | Sequence[Run],
    path: str | Path,
    *,
    title: str,
    tables: Mapping[str, Table] | None = None,
    figures: Mapping[str, Figure | bytes] | None = None,
    config_text: str = "",
    captions: Sequence[str] | None = None,
    answer: Sequence[str] = (),
    groups: Mapping[str, Sequence[int]] | None = None,
) -> Path:
    """Write a report as one self-contained page, light or dark as its reader's system is.

    Parameters
    ----------
    runs
        What was run; at least one.
    path
        The file; it appears whole or not at all.
    title
        Plain text.
    tables
        By heading: one mapping a row, from column to cell. None: the metrics of the runs, by joint.
    figures
        By caption, or by a name that `figures` gives; one that is drawn already as its SVG.
        None: those.
    config_text
        The configuration, as it was read.
    captions
        One a run; None: their names.
    answer
        What the runs say, in lines, the most important first; it stands above all else.
    groups
        Runs that were made under one condition, by its name, as indices; the replay shows the
        first, its first six, and a menu has the others. None: all are one group.

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
    drawn: Mapping[str, Figure | bytes] = standard_figures(several) if figures is None else figures
    if tables is None:
        rows = Comparison(("",), tuple(names), tuple(several)).joint_rows()
        for row in rows:
            del row["condition"]
        tables = {"Figures of merit": rows}
    marks = {run.name: colour(k) for k, run in reversed(list(enumerate(several)))}
    cells = {name: figure_html(name, figure) for name, figure in drawn.items()}
    parted = groups or {"": range(len(several))}
    parts = [answer_html(answer) + _outcomes(several, names, parted)]
    if "ranking" in cells:
        parts.append(section("Ranking", f'<div class="figures">{cells.pop("ranking")}</div>'))
    replay, frame = _replay(several, names, title, parted)
    parts.append(frame)
    if cells:
        parts.append(section("Figures", f'<div class="figures">{"".join(cells.values())}</div>'))
    parts += [section(heading, table_html(rows, marks)) for heading, rows in tables.items() if rows]
    if config_text:
        parts.append(section("Configuration", f"<pre>{as_text(config_text, keep=_LINES)}</pre>"))
    parts.append(section("Versions", table_html(_versions(several, names))))
    return put_text(path, page_html(title, parts, replay))


def answer_html(lines: Sequence[str]) -> str:
    """Return what is to be read first, the most important line first."""
    return "".join(
        f'<p class="{"answer" if k == 0 else "about"}">{as_text(line)}</p>'
        for k, line in enumerate(lines)
    )


def _replay(
    runs: Sequence[Run], captions: Sequence[str], title: str, groups: Mapping[str, Sequence[int]]
) -> tuple[str, str]:
    """Return the replay's page, and the section that holds it with a menu of the groups."""
    seen = {name: list(members)[:MOST_IN_REPLAY] for name, members in groups.items()}
    kept = sorted({k for members in seen.values() for k in members})
    places = {name: [kept.index(k) for k in members] for name, members in seen.items()}
    page = replay_html(
        [runs[k] for k in kept], captions=[captions[k] for k in kept], title=title, groups=places
    )
    heading, menu = "Replay", ""
    if any(len(members) > MOST_IN_REPLAY for members in groups.values()):
        heading += f" of the first {MOST_IN_REPLAY} runs"
    if len(groups) > 1:
        options = "".join(
            f'<option value="{k}">{as_text(name)}</option>' for k, name in enumerate(groups)
        )
        menu = f'<p><label>Condition <select id="group">{options}</select></label></p>'
    return page, section(heading, menu + framed(page, 'title="replay"'))


def _versions(runs: Sequence[Run], captions: Sequence[str]) -> Table:
    return [
        {"run": caption, **run.meta.get("versions", {}), "seed": str(run.meta.get("seed", "")),
         "platform": run.meta.get("platform", "")}
        for run, caption in zip(runs, captions, strict=True)
    ]  # fmt: skip


def _cell(value: object) -> str:
    if isinstance(value, Link):
        return value.html
    if isinstance(value, (bool, np.bool_)):
        return "yes" if value else "no"
    if isinstance(value, (float, np.floating)):
        return f"{value:.4g}"
    return as_text(str(value))


def table_html(table: Table, marks: Mapping[str, str] | None = None) -> str:
    """Return a table; cells that are a key of `marks` have its colour before them.

    A long one is folded.
    """
    heads = list(dict.fromkeys(head for row in table for head in row))
    rows = [[row.get(head, "") for head in heads] for row in table]
    # A row's weight says that it is the best; the column that does is for files.
    if heads[-1] == _BEST:
        heads.pop()
    words = [
        ' class="text"' if all(isinstance(row[k], str) for row in rows) else ""
        for k in range(len(heads))
    ]

    def write(head: object, kind: str, cell: object) -> str:
        mark = (marks or {}).get(cell) if isinstance(cell, str) else None
        text = _cell(cell)
        if mark:
            text = f'<span><i class="swatch" style="background: {mark}"></i>{text}</span>'
        return f'<td{kind} data-head="{_cell(head)}">{text}</td>'

    head = "".join(
        f'<th scope="col"{kind}>{_cell(text)}</th>' for text, kind in zip(heads, words, strict=True)
    )
    body = ""
    for row in rows:
        cells = "".join(write(*parts) for parts in zip(heads, words, row, strict=False))
        body += f'<tr class="best">{cells}</tr>' if row[-1] == _BEST else f"<tr>{cells}</tr>"
    kind = ' class="many"' if len(heads) > _MANY else ""
    element = f"<table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    element = f'<div class="wide" tabindex="0">{element}</div>'
    if len(rows) * len(heads) <= _LONG:
        return element
    return f"<details><summary>{len(rows)} rows</summary>{element}</details>"


def figure_html(name: str, figure: Figure | bytes) -> str:
    """Return a figure under its caption, which is its name unless we know a better one."""
    what, _, of = name.partition("-")
    caption = _CAPTIONS.get(what, name)
    if of and what in _CAPTIONS:
        caption = f"{caption}: {of}"
    svg = inline_svg(figure, name)
    size = re.search(r'viewBox="0 0 ([\d.]+) ([\d.]+)"', svg)
    width, height = (float(x) / 72.0 for x in size.groups()) if size else (1.0, 1.0)
    kind = ' class="broad"' if width > 8.0 and width > 1.3 * height else ""
    return f"<figure{kind}>{svg}<figcaption>{as_text(caption)}</figcaption></figure>"


def inline_svg(figure: Figure | bytes, name: str) -> str:
    """Return a figure as an SVG element whose ink and paper are those of the page around it."""
    drawn = figure if isinstance(figure, bytes) else figure_bytes(figure, "svg")
    text = drawn.decode("utf-8")
    text = text[text.index("<svg") :]
    text = text.replace(INK, "currentColor").replace("fill: #ffffff", "fill: none")
    # Ids must differ between figures of one page; references to them are all of these forms.
    prefix = re.sub(r"[^a-zA-Z0-9]", "-", name) + "-"
    text = re.sub(r'\bid="', f'id="{prefix}', text)
    text = re.sub(r'href="#', f'href="#{prefix}', text)
    text = text.replace("url(#", f"url(#{prefix}")
    return text.replace("<svg ", f'<svg role="img" aria-label="{as_text(name)}" ', 1)


def _outcomes(
    runs: Sequence[Run], captions: Sequence[str], groups: Mapping[str, Sequence[int]]
) -> str:
    """Return a line for each run that did not end as planned, with its condition if any differ."""
    named = groups if len(groups) > 1 else {}
    under = {k: f"{name}, " for name, members in named.items() for k in members}
    lines = [
        f"{under.get(k, '')}{captions[k]}: {run.outcome}"
        for k, run in enumerate(runs)
        if not run.outcome.completed
    ]
    return "".join(f'<p class="bad">{as_text(line)}</p>' for line in lines)


def section(heading: str, content: str) -> str:
    """Return a part of a page, of HTML, which `page_html` gives a link to."""
    anchor = re.sub(r"[^a-z0-9]+", "-", heading.lower()).strip("-") or "section"
    return f'<section id="{anchor}"><h2>{as_text(heading)}</h2>{content}</section>'


def page_html(title: str, parts: Sequence[str], replay: str = "") -> str:
    """Return a page of parts: what stands above the links first, then sections."""
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
        scripts=[asset("report.js")],
        embedded=replay,
    )
