"""What commands leave behind of runs: a folder with tables, figures, a report, and the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.cli.comparison import (
    LEGEND,
    Entry,
    Ranking,
    answer,
    joint_rows,
    limit_rows,
    run_rows,
    screen_rows,
)
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.output import file_names
from fpid_pin.cli.table import (
    Row,
    comma_separated,
    drop_constant,
    in_markdown,
    markdown,
    print_table,
    say,
)
from fpid_pin.resources import installed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class OutputOptions:
    """Options of the commands that simulate."""

    runs: bool = True  # whether they are saved; compressed where pcodec is installed
    figures: bool = True
    every: int = 1  # one row of a run in so many is saved; tables and figures are of all rows
    png: bool = False  # beside SVG

    def __post_init__(self) -> None:
        checks.integer("--every", self.every, low=1)


def write_results(
    folder: Path,
    config: Config,
    entries: Sequence[Entry],
    said: Sequence[str],
    tables: Mapping[str, list[Row]],
    figures: Mapping[str, Figure],
    options: OutputOptions,
    *,
    title: str = "",
    first: str = "",
) -> None:
    """Write runs, tables, figures, report and configuration into a folder.

    `said` are lines that stand above the tables, the most important first; `first` is the condition
    that the replay shows, `title` the report's where it is not the configuration's.
    """
    from fpid_pin.view.report import report_html
    from fpid_pin.view.style import figure_bytes

    title = title or config.title
    if options.runs:
        for entry in entries:
            compressed = installed("pcodec")
            entry.run.save(folder / entry.file, compressed=compressed, every=options.every)
    tables = {
        head: drop_constant(drop_constant(rows, "condition"), "outcome")
        for head, rows in tables.items()
        if rows
    }
    if not options.runs:
        tables["All joints"] = [
            {head: value for head, value in row.items() if head != "file"}
            for row in tables["All joints"]
        ]
    files = {"config.toml": config.text}
    for name, head in (("summary", "All joints"), ("joints", "Each joint"), ("limits", "Limits")):
        if head in tables:
            files[f"{name}.csv"] = comma_separated(tables[head])
    files["summary.md"] = "\n".join([
        f"# {in_markdown(title)}\n",
        "".join(f"- {in_markdown(line)}\n" for line in said),
        *(f"## {head}\n\n{markdown(rows)}" for head, rows in tables.items()),
    ])  # fmt: skip
    for name, text in files.items():
        (folder / name).write_text(text, encoding="utf-8")
    drawn = {name: figure_bytes(figure, "svg") for name, figure in figures.items()}
    for name, svg in drawn.items():
        (folder / f"{name}.svg").write_bytes(svg)
        if options.png:
            (folder / f"{name}.png").write_bytes(figure_bytes(figures[name], "png"))
    conditions = list(dict.fromkeys(entry.condition for entry in entries))
    conditions.sort(key=lambda name: name != first)
    report_html(
        [entry.run for entry in entries],
        folder / "report.html",
        title=title,
        tables=tables,
        figures=drawn,
        config_text=config.text,
        captions=[entry.controller for entry in entries],
        answer=said,
        groups={c: [k for k, e in enumerate(entries) if e.condition == c] for c in conditions},
    )


def write_comparison(
    folder: Path,
    config: Config,
    entries: Sequence[Entry],
    ranking: Ranking,
    figures: Mapping[str, Figure],
    options: OutputOptions,
) -> None:
    """Write what `run`, `compare` and `demo` leave behind: see `write_results`."""
    tables = {
        "All joints": run_rows(entries, ranking),
        "Each joint": joint_rows(entries),
        "Limits": limit_rows(entries),
    }
    said = [*answer(entries, ranking), LEGEND, dynamics_of(entries)]
    # The hardest condition first: that is where controllers differ.
    first = ranking.conditions[ranking.hardest]
    write_results(folder, config, entries, said, tables, figures, options, first=first)


def show_comparison(config: Config, entries: Sequence[Entry], ranking: Ranking, out: Path) -> None:
    """Print the answer, the figures behind it, and where everything is."""
    say(*answer(entries, ranking))
    print_table(drop_constant(screen_rows(run_rows(entries, ranking)), "condition"), config.title)
    say(
        LEGEND,
        f"{dynamics_of(entries)}; *: best",
        f"Written to {out}: report.html (open it in a browser), figures, tables, runs",
    )


def dynamics_of(entries: Sequence[Entry]) -> str:
    """Say which dynamics have made runs."""
    return f"dynamics: {entries[0].run.meta['experiment']['dynamics']}"


def comparison_figures(
    config: Config, entries: Sequence[Entry], ranking: Ranking
) -> dict[str, Figure]:
    """Draw the ranking, the runs under each condition, and gains of laws whose orders move."""
    from fpid_pin.view import plots
    from fpid_pin.view.plots import ORDERS, has_all

    label = f"{ranking.measure.label}, {ranking.measure.unit}".removesuffix(", ")
    figures = {
        "ranking": plots.heat_map(ranking.values, ranking.controllers, ranking.conditions, label)
    }
    figures |= condition_figures(entries)
    moving = [e for e in entries[: len(config.controllers)] if has_all(e.run, ORDERS)]
    stems = file_names([[entry.controller] for entry in moving], prefix="gains-")
    return figures | {s: plots.gains(e.run) for s, e in zip(stems, moving, strict=True)}


def condition_figures(entries: Sequence[Entry]) -> dict[str, Figure]:
    """Draw the runs under each condition beside each other."""
    from fpid_pin.view import plots

    conditions = list(dict.fromkeys(entry.condition for entry in entries))
    many = file_names([[condition] for condition in conditions], prefix="comparison-")
    names = many if len(many) > 1 else ["comparison"]
    return {
        name: plots.comparison([e.run for e in entries if e.condition == condition])
        for name, condition in zip(names, conditions, strict=True)
    }


def run_figures(entry: Entry) -> dict[str, Figure]:
    """Draw one run."""
    from fpid_pin.view import plots

    run = entry.run
    figures = {
        "tracking": plots.tracking(run), "torque": plots.torque(run), "error": plots.error(run)
    }  # fmt: skip
    return figures | ({"gains": plots.gains(run)} if "kp" in run.signals else {})
