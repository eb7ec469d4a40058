"""What commands leave behind of runs: a folder with tables, figures, a report, and the runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.cli import screen
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.output import file_names
from fpid_pin.control import Controller
from fpid_pin.resources import installed
from fpid_pin.simulation import Comparison, Experiment, compare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Columns that a screen has room for: condition, controller and the first figures.
_ON_SCREEN = 8


@dataclass(frozen=True)
class OutputOptions:
    """What is written beside tables and the report."""

    runs: bool = True  # whether they are saved; compressed where pcodec is installed
    figures: bool = True
    every: int = 1  # one row of a run in so many is saved; tables and figures are of all rows
    png: bool = False  # beside SVG

    def __post_init__(self) -> None:
        checks.integer("--every", self.every, low=1)


def simulate_all(
    experiments: Mapping[str, Experiment], controllers: Mapping[str, Controller], metric: str | None
) -> tuple[Comparison, list[str]]:
    """Compare controllers, with a bar on the screen; return also a file's name for each run."""
    labels = [
        [condition, name] if len(experiments) > 1 else [name]
        for condition in experiments
        for name in controllers
    ]
    files = [f"{stem}.npz" for stem in file_names(labels, taken=["checkpoint"])]
    with screen.progress_bar(f"simulating {len(files)} run{'s' * (len(files) > 1)}") as bar:
        return compare(experiments, controllers, metric, progress=bar), files


def write_results(
    folder: Path,
    config: Config,
    comparison: Comparison,
    names: Sequence[str],
    figures: Mapping[str, Figure],
    options: OutputOptions,
    said: Sequence[str] = (),
    tables: Mapping[str, list[screen.Row]] | None = None,
) -> None:
    """Write runs, tables, figures, report and configuration into a folder.

    `names` are those of the runs' files; `said` and `tables` stand above what is said of every
    comparison, the most important first.
    """
    from fpid_pin.view.report import report_html
    from fpid_pin.view.style import figure_bytes

    said = [*said, *comparison.answer, comparison.legend, dynamics_of(comparison)]
    rows = comparison.rows()
    if options.runs:
        for row, run, name in zip(rows, comparison.runs, names, strict=True):
            run.save(folder / name, compressed=installed("pcodec"), every=options.every)
            # The last column says which is the best.
            last = {"best": row.pop("best")} if "best" in row else {}
            row.update({"file": name} | last)
    own = {
        "Each run": rows, "Each joint": comparison.joint_rows(), "Limits": comparison.limit_rows()
    }  # fmt: skip
    shown = {
        head: screen.drop_constant(screen.drop_constant(table, "condition"), "outcome")
        for head, table in {**(tables or {}), **own}.items()
        if table
    }
    texts = {"config.toml": config.text}
    for name, head in zip(("summary", "joints", "limits"), own, strict=True):
        if head in shown:
            texts[f"{name}.csv"] = screen.comma_separated(shown[head])
    texts["summary.md"] = "\n".join([
        f"# {screen.in_markdown(config.title)}\n",
        "".join(f"- {screen.in_markdown(line)}\n" for line in said),
        *(f"## {head}\n\n{screen.markdown(table)}" for head, table in shown.items()),
    ])  # fmt: skip
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    drawn = {name: figure_bytes(figure, "svg") for name, figure in figures.items()}
    for name, svg in drawn.items():
        (folder / f"{name}.svg").write_bytes(svg)
        if options.png:
            (folder / f"{name}.png").write_bytes(figure_bytes(figures[name], "png"))
    many = len(comparison.controllers)
    groups = {
        condition: range(many * k, many * (k + 1))
        for k, condition in enumerate(comparison.conditions)
    }
    # The hardest condition first: that is where controllers differ.
    groups = {comparison.hardest: groups[comparison.hardest]} | groups
    report_html(
        comparison.runs, folder / "report.html", title=config.title, tables=shown, figures=drawn,
        config_text=config.text, captions=comparison.controllers * len(groups), answer=said,
        groups=groups,
    )  # fmt: skip


def show(config: Config, comparison: Comparison, out: Path) -> None:
    """Print the answer, the figures behind it, and where everything is."""
    rows = [dict([*row.items()][:_ON_SCREEN], best=row["best"]) for row in comparison.rows()]
    screen.say(*comparison.answer)
    screen.print_table(screen.drop_constant(rows, "condition"), config.title)
    screen.say(
        comparison.legend,
        f"{dynamics_of(comparison)}; *: best",
        f"Written to {out}: report.html (open it in a browser), figures, tables, runs",
    )


def dynamics_of(comparison: Comparison) -> str:
    """Say which dynamics have made runs."""
    return f"dynamics: {comparison.runs[0].meta['experiment']['dynamics']}"


def figures_of(comparison: Comparison) -> dict[str, Figure]:
    """Draw one run, or several: the ranking, those under each condition, orders that move."""
    from fpid_pin.view import plots
    from fpid_pin.view.plots import ORDERS, has_all

    many, measure, first = len(comparison.controllers), comparison.measure, comparison.runs[0]
    if len(comparison.runs) == 1:
        figures = {
            "tracking": plots.tracking(first), "torque": plots.torque(first),
            "error": plots.error(first),
        }  # fmt: skip
        return figures | ({"gains": plots.gains(first)} if "kp" in first.signals else {})
    figures = {}
    if measure is not None:
        label = f"{measure.label}, {measure.unit}".removesuffix(", ")
        figures["ranking"] = plots.heat_map(
            comparison.values, comparison.controllers, comparison.conditions, label
        )
    names = ["comparison"]
    if len(comparison.conditions) > 1:
        names = file_names([[name] for name in comparison.conditions], prefix="comparison-")
    for k, name in enumerate(names):
        figures[name] = plots.comparison(comparison.runs[many * k : many * (k + 1)])
    laws = zip(comparison.controllers, comparison.runs, strict=False)
    moving = {name: run for name, run in laws if has_all(run, ORDERS)}
    stems = file_names([[name] for name in moving], prefix="gains-")
    return figures | {s: plots.gains(r) for s, r in zip(stems, moving.values(), strict=True)}
