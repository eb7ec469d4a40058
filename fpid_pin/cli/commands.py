"""The subcommands of `fpid-pin`: functions that a script may call just as well.

What takes long to import is imported when they are called: ``fpid-pin --help`` is quick.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from fpid_pin._version import __version__
from fpid_pin.cli import campaign
from fpid_pin.cli import options as option
from fpid_pin.cli.options import AllowImport, ConfigFile
from fpid_pin.cli.output import file_names, output_folder, results_path
from fpid_pin.cli.screen import print_table, say, say_written
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.files import require_file

if TYPE_CHECKING:
    from fpid_pin.cli.configuration import Config
    from fpid_pin.cli.results import OutputOptions

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"fpid-pin {__version__}")
        raise typer.Exit


@app.callback()
def top(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Adaptive fractional-order PID control of robot arms on Pinocchio."""


@app.command()
def demo(
    out: option.OutputPath = None, no_figures: option.NoFigures = False, png: option.Png = False
) -> None:
    """Run section 5.1 of the paper: fractional against integer PID."""
    from fpid_pin.cli import configuration
    from fpid_pin.cli.results import OutputOptions

    options = OutputOptions(figures=not no_figures, png=png)
    _compare(configuration.demo_config(), out or Path("runs/demo"), "tail", options, demo=True)


@app.command()
def run(
    config: ConfigFile,
    out: option.OutputPath = None,
    controller: option.Chosen = None,
    condition: option.Condition = None,
    every: option.Every = 1,
    no_runs: option.NoRuns = False,
    no_figures: option.NoFigures = False,
    png: option.Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Simulate one controller of a configuration."""
    from fpid_pin.cli.configuration import load
    from fpid_pin.cli.results import OutputOptions

    options = OutputOptions(not no_runs, not no_figures, every, png)
    found = load(config, allow_import)
    one = found.only(controller).under(condition)
    if falling := one.experiment.joints_that_fall():
        lines = [f"{line}; it falls under any controller" for line in falling]
        raise ConfigError.of(config, lines)
    (stem,) = file_names([[*one.controllers, condition or ""]], prefix="-run-")
    _compare(one, out or results_path(config, stem), "tail", options)


@app.command()
def compare(
    config: ConfigFile,
    out: option.OutputPath = None,
    metric: Annotated[
        str,
        typer.Option(help="Rank by tail, rms, peak_error, cost, energy, variation or peak."),
    ] = "tail",
    every: option.Every = 1,
    no_runs: option.NoRuns = False,
    no_figures: option.NoFigures = False,
    png: option.Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Simulate every controller under every condition."""
    from fpid_pin.cli.configuration import load
    from fpid_pin.cli.results import OutputOptions

    options = OutputOptions(not no_runs, not no_figures, every, png)
    _compare(load(config, allow_import), out or results_path(config), metric, options)


def _compare(
    config: Config, out: Path, metric: str, options: OutputOptions, *, demo: bool = False
) -> None:
    """Simulate all pairs, write the folder of results and print the answer."""
    from fpid_pin import checks
    from fpid_pin.cli.results import figures_of, show, simulate_all, write_results
    from fpid_pin.simulation.comparison import MEASURES
    from fpid_pin.view import figures as paper_figures

    checks.choice("--metric", metric, MEASURES)
    with output_folder(out) as folder:
        comparison, files = simulate_all(config.conditions, config.controllers, metric)
        draw = (lambda found: paper_figures(found.runs)) if demo else figures_of
        figures = draw(comparison) if options.figures else {}
        write_results(folder, config.at(out), comparison, files, figures, options)
        if demo:
            _playground(config, folder / "playground.html")
    show(config, comparison, out)


@app.command()
def tune(
    config: ConfigFile,
    out: option.OutputPath = None,
    resume: Annotated[bool, typer.Option("--resume", help="Continue from the checkpoint.")] = False,
    controller: option.Chosen = None,
    condition: option.Condition = None,
    workers: option.Workers = None,
    dask: option.Dask = None,
    png: option.Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Search better orders and gains, as set in the table [tune]."""
    from fpid_pin.cli.tune import run_tuning

    out = out or results_path(config, "-tuned")
    run_tuning(config, out, resume, controller, condition, workers, dask, png, allow_import)


@app.command()
def operators(
    order: Annotated[list[float] | None, typer.Option(help="Order in [0, 1]; repeatable.")] = None,
    step: Annotated[float, typer.Option(help="Sampling step [s].")] = 1e-3,
    horizon: Annotated[float, typer.Option(help="Longest time [s].")] = 20.0,
    design: Annotated[str, typer.Option(help="exponential_sum or crone.")] = "exponential_sum",
    modes: Annotated[int | None, typer.Option(help="Modes of the exponential sum.")] = None,
    tolerance: Annotated[float | None, typer.Option(help="Accuracy, instead of modes.")] = None,
    band: Annotated[tuple[float, float], typer.Option(help="CRONE band [rad/s].")] = (1e-2, 1e3),
    n: Annotated[int, typer.Option("--n", help="CRONE: 2N+1 poles.")] = 5,
    widening: Annotated[float, typer.Option(help="CRONE: extra band [decades].")] = 0.0,
    plot: Annotated[Path | None, typer.Option(help="Draw the errors into this file.")] = None,
) -> None:
    """Print how accurate a fractional operator is."""
    from fpid_pin import checks
    from fpid_pin.fractional import Crone, ExponentialSum, report

    crone = checks.choice("design", design, ("exponential_sum", "crone")) == "crone"
    step = checks.sampling_step(step)
    horizon = checks.number("horizon", horizon, above=0.0, high=step * checks.MOST_ROWS)
    chosen = Crone(*band, n, widening) if crone else ExponentialSum(modes, tolerance)
    found = report(chosen, order or [0.1, 0.5, 0.9], step=step, horizon=horizon)
    if plot is not None:
        try:
            found.plot(plot)
        except ValueError as error:
            raise ArgumentError("plot", "a file that can be written", f"{plot} ({error})") from None
    say(*found.heading)
    print_table(found.rows)


@app.command()
def arms() -> None:
    """List the arms that have a name, with limits and friction."""
    from fpid_pin.cli.arms import arm_rows

    print_table(arm_rows(), "Arms")


@app.command()
def inspect(
    arm: option.ArmName,
    lock: option.Locks = None,
    bandwidth: Annotated[float, typer.Option(help="Of the suggested gains [rad/s].")] = 10.0,
    step: Annotated[float, typer.Option(help="Sampling step [s].")] = 1e-3,
    picture: Annotated[Path | None, typer.Option(help="Draw the arm: .svg, .png or .pdf.")] = None,
    keep: option.Tip = None,
    package_dir: option.PackageDirs = None,
    tool: option.Tool = None,
    inertia: option.Inertia = None,
) -> None:
    """Print joints, limits, inertia and suggested gains of an arm."""
    from fpid_pin.cli.arms import arm_table, run_inspect

    table = arm_table(arm, lock, keep=keep, package_dirs=package_dir, tool=tool, inertia=inertia)
    run_inspect(table, bandwidth, step, picture)


@app.command()
def init(
    arm: option.ArmName,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("config.toml"),
    lock: option.Locks = None,
    keep: option.Tip = None,
    package_dir: option.PackageDirs = None,
    tool: option.Tool = None,
    inertia: option.Inertia = None,
) -> None:
    """Write a commented configuration that `compare` can run."""
    from fpid_pin.cli.arms import arm_table, run_init

    table = arm_table(arm, lock, keep=keep, package_dirs=package_dir, tool=tool, inertia=inertia)
    run_init(arm, table, out)


@app.command()
def view(
    files: Annotated[list[Path], typer.Argument(metavar="RUN.npz ...", help="Recorded runs.")],
    html: option.Page = None,
    caption: Annotated[list[str] | None, typer.Option(help="Caption of each run.")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 30.0,
    browser: option.Browser = True,
    port: option.Port = None,
) -> None:
    """Show recorded runs in 3D, in a browser or as one page."""
    from fpid_pin.simulation import Run
    from fpid_pin.view import export_html, play

    if html is not None:
        require_file(html)
    runs = [Run.load(file) for file in files]
    if html is not None:
        say_written(export_html(runs, html, captions=caption or None, fps=fps))
        return
    play(runs, fps=fps, captions=caption or None, open_browser=browser, port=port, announce=say)


@app.command()
def playground(
    config: ConfigFile,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("playground.html"),
    controller: Annotated[str | None, typer.Option(help="Controller; default: all.")] = None,
    condition: option.Condition = None,
    allow_import: AllowImport = False,
) -> None:
    """Write one page with sliders that simulates as you move them."""
    from fpid_pin.cli.configuration import load

    require_file(html)
    found = load(config, allow_import)
    found = found if controller is None else found.only(controller)
    for line in _playground(found.under(condition), html):
        say(f"fpid-pin: left out: {line}", error=True)
    say_written(html)


def _playground(config: Config, html: Path) -> list[str]:
    """Write a page of the controllers that it can hold; return a line for each that it cannot."""
    from fpid_pin.view.playground_engine import Law
    from fpid_pin.view.playground_page import playground

    kept: list[Law] = []
    left: list[str] = []
    for label, controller in config.controllers.items():
        try:
            kept.append(Law(controller, config.experiment, kept))
        except FpidError as error:
            left.append(f"{label}: {error}")
    if not kept:
        raise ConfigError.of(config.path, left)
    playground(config.experiment, [law.controller for law in kept], html, title=config.title)
    return left


@app.command()
def live(
    config: ConfigFile,
    controller: option.Chosen = None,
    condition: option.Condition = None,
    duration: Annotated[float | None, typer.Option(help="[s]; default: until Ctrl-C.")] = None,
    fps: Annotated[float, typer.Option(help="Frames per second.")] = 40.0,
    browser: option.Browser = True,
    port: option.Port = None,
    joint: Annotated[str | None, typer.Option(help="Joint that a key press pushes.")] = None,
    push: Annotated[float | None, typer.Option(help="[N m], of a slide [N].")] = None,
    baseline: Annotated[float, typer.Option(help="First run without the view [s].")] = 0.0,
    allow_import: AllowImport = False,
) -> None:
    """Run the control loop in real time; press keys to push a joint."""
    from fpid_pin import checks
    from fpid_pin.cli.configuration import load
    from fpid_pin.view.live_session import HELP
    from fpid_pin.view.live_session import live as show

    found = load(config, allow_import)
    found = found.only(controller or next(iter(found.controllers))).under(condition)
    experiment, (law,) = found.experiment, found.controllers.values()
    if checks.number("--baseline", baseline, low=0.0):
        say(f"{baseline:g} s without the view, to compare ...")
        alone = show(experiment, law, duration=baseline, view=False)
        say(f"without the view: {alone.timing}")
    say(HELP)
    told = show(
        experiment, law, duration=duration, fps=fps, open_browser=browser, port=port,
        push_joint=joint or 0, push_torque=push, announce=say,
    )  # fmt: skip
    say(*f"with the view:    {told}".splitlines())


@app.command()
def export(
    config: ConfigFile,
    out: Annotated[Path, typer.Option("--out", help="Folder to create.")],
    controller: option.Chosen = None,
    horizon: Annotated[float, typer.Option(help="Longest running time [s].")] = 3600.0,
    ticks: Annotated[int, typer.Option(help="Number of ticks in the test vectors.")] = 2000,
    allow_import: AllowImport = False,
) -> None:
    """Write a controller as C99, with test vectors."""
    from fpid_pin.cli.configuration import load
    from fpid_pin.export import export_c

    found = load(config, allow_import).only(controller)
    experiment, ((name, law),) = found.experiment, found.controllers.items()
    options = f"--horizon {horizon:g} --ticks {ticks}"
    folder = export_c(
        law, experiment.arm, experiment.step, out, horizon=horizon,
        ticks=ticks, experiment=experiment,
        toml=f"# Exported: controller {name!r}, {options}.\n{found.at(out).text}",
    )  # fmt: skip
    say(f"{folder}: fpid.h, fpid.c, fpid_parameters.c, example, check, README.md")


app.add_typer(campaign.app, name="campaign")
