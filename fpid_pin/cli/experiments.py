"""`demo`, `run` and `compare`: simulate, print the table, write the folder of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.cli import summary
from fpid_pin.cli.choice import pick
from fpid_pin.cli.config import load, parse
from fpid_pin.cli.configuration import Config
from fpid_pin.cli.keep import ALL, Keep
from fpid_pin.cli.names import file_names
from fpid_pin.cli.output import output_folder
from fpid_pin.cli.pairs import simulate_pairs
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.screen import print_table, say, screen
from fpid_pin.cli.summary import Entry
from fpid_pin.cli.verdict import LEGEND, MEASURES, Ranking, answer, rank
from fpid_pin.simulation import Run, simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def demo_config() -> Config:
    """Return the configuration that `demo` runs, from the package."""
    text = resources.files("fpid_pin.cli").joinpath("demo.toml").read_text(encoding="utf-8")
    return parse(text, "demo.toml", Path.cwd())


def run_demo(out: Path, keep: Keep = ALL) -> None:
    """Run section 5.1 with fractional (two readings) and integer orders."""
    from fpid_pin.cli.playground import make
    from fpid_pin.view import figures

    config = demo_config()
    with output_folder(out) as folder:
        entries = simulate_all(config)
        ranking = rank(entries, MEASURES["tail"])
        drawn = figures([entry.run for entry in entries]) if keep.figures else {}
        write(folder, config, entries, ranking, drawn, keep)
        make(config, folder / "playground.html")
    show(entries, ranking, config.title, out)


def run_one(path: Path, out: Path, name: str | None, keep: Keep = ALL) -> None:
    """Run one controller of a configuration."""
    config = load(path)
    chosen = pick(config, name)
    (file,) = file_names([[chosen]])
    with output_folder(out) as folder:
        controller = config.controllers[chosen]
        with progress_bar("simulating") as progress:
            run = simulate(config.experiment, controller, progress=progress)
        entries = [Entry("nominal", chosen, run, f"{file}.npz")]
        ranking = rank(entries, MEASURES["tail"])
        write(folder, config, entries, ranking, _figures(run) if keep.figures else {}, keep)
    show(entries, ranking, config.title or path.stem, out)


def _figures(run: Run) -> dict[str, Figure]:
    from fpid_pin.view import plots

    figures = {
        "tracking": plots.tracking(run),
        "torque": plots.torque(run),
        "error": plots.error(run),
    }
    if "kp" in run.signals:
        figures["gains"] = plots.gains(run)
    return figures


def run_comparison(path: Path, out: Path, metric: str = "tail", keep: Keep = ALL) -> None:
    """Run every controller under every condition, and say who is best by a metric."""
    measure = MEASURES[checks.choice("--metric", metric, MEASURES)]
    config = load(path)
    with output_folder(out) as folder:
        entries = simulate_all(config)
        ranking = rank(entries, measure)
        figures = _comparisons(config, entries, ranking) if keep.figures else {}
        write(folder, config, entries, ranking, figures, keep)
    show(entries, ranking, config.title or path.stem, out)


def _comparisons(config: Config, entries: Sequence[Entry], ranking: Ranking) -> dict[str, Figure]:
    from fpid_pin.view import plots
    from fpid_pin.view.panels import ORDERS, has_all

    label = f"{ranking.measure.label}, {ranking.measure.unit}".removesuffix(", ")
    figures = {
        "ranking": plots.heat_map(ranking.values, ranking.controllers, ranking.conditions, label)
    }
    names = file_names([[condition] for condition in config.conditions], prefix="comparison-")
    for name, condition in zip(names, config.conditions, strict=True):
        runs = [entry.run for entry in entries if entry.condition == condition]
        figures[name] = plots.comparison(runs)
    moving = [e for e in entries[: len(config.controllers)] if has_all(e.run, ORDERS)]
    stems = file_names([[entry.controller] for entry in moving], prefix="gains-")
    for stem, entry in zip(stems, moving, strict=True):
        figures[stem] = plots.gains(entry.run)
    return figures


def simulate_all(config: Config) -> list[Entry]:
    """Simulate every controller of a configuration under every condition."""
    return simulate_pairs(config.conditions, config.controllers)


def write(
    folder: Path,
    config: Config,
    entries: Sequence[Entry],
    ranking: Ranking,
    figures: Mapping[str, Figure],
    keep: Keep = ALL,
) -> None:
    """Write runs, tables, figures, report and configuration into `folder`."""
    from fpid_pin.view.report import report_html

    (folder / "config.toml").write_text(config.text, encoding="utf-8")
    for entry in entries:
        keep.save(entry.run, folder / entry.file)
    tables = {
        "All joints": summary.run_rows(entries, ranking),
        "Each joint": summary.joint_rows(entries),
        "Limits": summary.limit_rows(entries),
    }
    for constant in ("condition", "outcome"):
        tables = {head: summary.drop_constant(rows, constant) for head, rows in tables.items()}
    if not keep.runs:
        for row in tables["All joints"]:
            del row["file"]
    for name, head in (("summary", "All joints"), ("joints", "Each joint"), ("limits", "Limits")):
        if tables[head]:
            text = summary.comma_separated(tables[head])
            (folder / f"{name}.csv").write_text(text, encoding="utf-8")
    told = [*answer(entries, ranking), LEGEND, summary.dynamics_of(entries)]
    lines = "".join(f"- {summary.in_markdown(line)}\n" for line in told)
    sections = [
        f"# {summary.in_markdown(config.title or config.path)}\n",
        lines,
        *(summary.markdown(rows) for rows in tables.values() if rows),
    ]
    (folder / "summary.md").write_text("\n".join(sections), encoding="utf-8")
    drawn = keep.draw(figures, folder)
    # The hardest condition first: that is where controllers differ.
    ahead = ranking.conditions[ranking.hardest]
    order = sorted(ranking.conditions, key=lambda name: name != ahead)
    report_html(
        [entry.run for entry in entries],
        folder / "report.html",
        title=config.title or Path(config.path).stem,
        tables=tables,
        figures=drawn,
        config_text=config.text,
        captions=[entry.controller for entry in entries],
        answer=told,
        groups={c: [k for k, e in enumerate(entries) if e.condition == c] for c in order},
    )


def show(entries: Sequence[Entry], ranking: Ranking, title: str, out: Path) -> None:
    """Print the answer, the figures behind it, and where everything is."""
    console = screen()
    for line in answer(entries, ranking):
        say(console, line)
    rows = summary.drop_constant(summary.run_rows(entries, ranking), "condition")
    print_table(console, summary.rich_table(rows, title or "Result"))
    say(console, f"{LEGEND}; {summary.dynamics_of(entries)}; *: best")
    say(console, f"Written to {out}: report.html (open it in a browser), figures, tables, runs")
