"""`demo`, `run` and `compare`: simulate, print the table, write the folder of results."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.cli import summary
from fpid_pin.cli.config import Config, load, parse
from fpid_pin.cli.output import OutputFolder
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.screen import say, screen
from fpid_pin.cli.summary import Entry
from fpid_pin.exceptions import ArgumentError, ConfigError
from fpid_pin.simulation import simulate

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def demo_config() -> Config:
    """Return the configuration that `demo` runs, from the package."""
    text = resources.files("fpid_pin.cli").joinpath("demo.toml").read_text(encoding="utf-8")
    return parse(text, "demo.toml", Path.cwd())


def run_demo(out: Path) -> None:
    """Run section 5.1 with fractional (two readings) and integer orders."""
    from fpid_pin.view import figures

    config = demo_config()
    with OutputFolder(out) as folder:
        entries = simulate_all(config)
        write(folder, config, entries, figures([entry.run for entry in entries]))
    show(entries, config.title, out)


def run_one(path: Path, out: Path, name: str | None) -> None:
    """Run one controller of a configuration."""
    from fpid_pin.view import plots

    config = load(path)
    if name is None and len(config.controllers) > 1:
        listed = ", ".join(config.controllers)
        raise ConfigError(f"{path}: expected one controller, or --controller NAME, got {listed}")
    try:
        chosen = name or next(iter(config.controllers))
        chosen = checks.choice("--controller", chosen, config.controllers)
    except ArgumentError as error:
        raise ConfigError(f"{path}: {error}") from None
    with OutputFolder(out) as folder:
        controller = config.controllers[chosen]
        with progress_bar("simulating") as progress:
            run = simulate(config.experiment, controller, progress=progress)
        entries = [Entry("nominal", chosen, run)]
        figures = {
            "tracking": plots.tracking(run),
            "torque": plots.torque(run),
            "error": plots.error(run),
        }
        if "kp" in run.signals:
            figures["gains"] = plots.gains(run)
        write(folder, config, entries, figures)
    show(entries, config.title or path.stem, out)


def run_comparison(path: Path, out: Path) -> None:
    """Run every controller under every condition."""
    from fpid_pin.view import plots

    config = load(path)
    with OutputFolder(out) as folder:
        entries = simulate_all(config)
        figures = {}
        for condition in config.conditions:
            runs = [entry.run for entry in entries if entry.condition == condition]
            figures[f"comparison-{_slug(condition)}"] = plots.comparison(runs)
        write(folder, config, entries, figures)
    show(entries, config.title or path.stem, out)


def simulate_all(config: Config) -> list[Entry]:
    """Simulate every pair of condition and controller in as few lockstep calls as may be."""
    keys = [(c, k) for c in config.conditions for k in config.controllers]
    experiments = [config.conditions[condition] for condition, _ in keys]
    controllers = [config.controllers[controller] for _, controller in keys]
    with progress_bar(f"simulating {len(keys)} runs") as progress:
        runs = simulate(experiments, controllers, progress=progress)
    return [Entry(*key, run) for key, run in zip(keys, runs, strict=True)]


def write(
    folder: Path, config: Config, entries: Sequence[Entry], figures: Mapping[str, Figure]
) -> None:
    """Write runs, tables, figures, report and configuration into `folder`."""
    from fpid_pin.view import plots
    from fpid_pin.view.report import report_html

    (folder / "config.toml").write_text(config.text, encoding="utf-8")
    many = len(config.conditions) > 1
    for entry in entries:
        parts = [entry.condition, entry.controller] if many else [entry.controller]
        entry.run.save(folder / f"{'-'.join(map(_slug, parts))}.npz")
    rows = summary.drop_constant(summary.run_rows(entries), "condition")
    joints = summary.drop_constant(summary.joint_rows(entries), "condition")
    (folder / "summary.csv").write_text(summary.comma_separated(rows), encoding="utf-8")
    (folder / "joints.csv").write_text(summary.comma_separated(joints), encoding="utf-8")
    remarks = "".join(f"- {summary.in_markdown(line)}\n" for line in summary.remarks(entries))
    sections = [
        f"# {summary.in_markdown(config.title or config.path)}\n",
        summary.markdown(rows),
        summary.markdown(joints),
        *([remarks] if remarks else []),
    ]
    (folder / "summary.md").write_text("\n".join(sections), encoding="utf-8")
    for name, figure in figures.items():
        plots.save_figure(figure, folder / f"{name}.svg")
        plots.save_figure(figure, folder / f"{name}.png")
    report_html(
        folder / "report.html",
        [entry.run for entry in entries],
        title=config.title or Path(config.path).stem,
        tables={"All joints": rows, "Each joint": joints},
        figures=figures,
        config_text=config.text,
        captions=[f"{e.controller}, {e.condition}" if many else e.controller for e in entries],
    )


def show(entries: Sequence[Entry], title: str, out: Path) -> None:
    """Print the comparison and say where everything is."""
    rows = summary.drop_constant(summary.run_rows(entries), "condition")
    console = screen()
    console.print(summary.rich_table(rows, title or "Result"))
    for line in summary.remarks(entries):
        say(console, line)
    say(console, f"Written to {out}: report.html (open it in a browser), figures, tables, runs")


def _slug(name: str) -> str:
    kept = "".join(c if c.isalnum() else "-" for c in name.lower())
    return "-".join(part for part in kept.split("-") if part) or "run"
