"""The subcommands of `fpid-pin`: their arguments, and whom they call."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fpid_pin._version import __version__
from fpid_pin.cli import campaign_commands
from fpid_pin.cli.options import AllowImport, ConfigFile, Dask, Workers

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
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print it.")
    ] = False,
) -> None:
    """Adaptive fractional-order PID control of robot arms on Pinocchio."""


app.add_typer(campaign_commands.app, name="campaign")

OutputPath = Annotated[Path | None, typer.Option("--out", help="Folder for the results.")]
ArmName = Annotated[str, typer.Argument(metavar="ARM", help="A name of `arms`, or a robot's file.")]
Locks = Annotated[list[str] | None, typer.Option(help="Hold a joint: NAME=VALUE; repeat.")]
Tip = Annotated[str | None, typer.Option(metavar="TIP", help="The arm's last link; hold the rest.")]
PackageDirs = Annotated[list[Path] | None, typer.Option(help="Where meshes are; repeat.")]
Tool = Annotated[str | None, typer.Option(metavar="FRAME", help="The tool's frame.")]
Every = Annotated[int, typer.Option(help="Save one row of a run in so many.")]
NoRuns = Annotated[bool, typer.Option("--no-runs", help="Save no runs.")]
Png = Annotated[bool, typer.Option("--png", help="Draw figures as PNG, too.")]
NoFigures = Annotated[bool, typer.Option("--no-figures", help="Draw no figures.")]


@app.command()
def demo(out: OutputPath = None, no_figures: NoFigures = False, png: Png = False) -> None:
    """Run section 5.1 of the paper: fractional against integer adaptive PID."""
    from fpid_pin.cli.experiments import run_demo
    from fpid_pin.cli.keep import Keep

    run_demo(out or Path("runs/demo"), Keep(figures=not no_figures, png=png))


@app.command()
def run(
    config: ConfigFile,
    out: OutputPath = None,
    controller: Annotated[str | None, typer.Option(help="Which controller, by name.")] = None,
    every: Every = 1,
    no_runs: NoRuns = False,
    no_figures: NoFigures = False,
    png: Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Simulate one controller of a configuration and record everything."""
    from fpid_pin.cli.experiments import run_one
    from fpid_pin.cli.keep import Keep

    keep = Keep(not no_runs, not no_figures, every, png)
    run_one(config, out or Path("runs") / config.stem, controller, keep)


@app.command()
def compare(
    config: ConfigFile,
    out: OutputPath = None,
    metric: Annotated[
        str,
        typer.Option(help="What decides: tail, rms, peak_error, cost, energy, variation or peak."),
    ] = "tail",
    every: Every = 1,
    no_runs: NoRuns = False,
    no_figures: NoFigures = False,
    png: Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Simulate every controller of a configuration under every condition, and say who is best."""
    from fpid_pin.cli.experiments import run_comparison
    from fpid_pin.cli.keep import Keep

    keep = Keep(not no_runs, not no_figures, every, png)
    run_comparison(config, out or Path("runs") / config.stem, metric, keep)


@app.command()
def tune(
    config: ConfigFile,
    out: OutputPath = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on from the checkpoint.")] = False,
    workers: Workers = None,
    dask: Dask = None,
    png: Png = False,
    allow_import: AllowImport = False,
) -> None:
    """Search orders and gains by the genetic algorithm of a configuration's [tune]."""
    from fpid_pin.cli.keep import Keep
    from fpid_pin.cli.tune import run_tuning

    folder = out or Path("runs") / f"{config.stem}-tuned"
    run_tuning(config, folder, resume, workers, Keep(png=png), dask)


@app.command()
def operators(
    order: Annotated[list[float] | None, typer.Option(help="An order in [0, 1]; repeat.")] = None,
    step: Annotated[float, typer.Option(help="Sampling step [s].")] = 1e-3,
    horizon: Annotated[float, typer.Option(help="Longest time [s].")] = 20.0,
    design: Annotated[str, typer.Option(help="exponential_sum or crone.")] = "exponential_sum",
    modes: Annotated[int | None, typer.Option(help="Modes of the exponential sum.")] = None,
    tolerance: Annotated[float | None, typer.Option(help="Or the accuracy wanted.")] = None,
    band: Annotated[tuple[float, float], typer.Option(help="Of CRONE [rad/s].")] = (1e-2, 1e3),
    n: Annotated[int, typer.Option("--n", help="Of CRONE: order 2n+1.")] = 5,
    widening: Annotated[float, typer.Option(help="Of CRONE's band [decades].")] = 0.0,
    plot: Annotated[Path | None, typer.Option(help="Figure of the errors.")] = None,
) -> None:
    """Say how good a fractional operator is: errors, trusted range, noise, cost."""
    from fpid_pin.cli.operators import operators_table

    text = operators_table(
        order or [0.1, 0.5, 0.9], step, horizon, design=design, modes=modes, tolerance=tolerance,
        band=band, n=n, widening=widening, plot=plot,
    )  # fmt: skip
    typer.echo(text)


@app.command()
def arms() -> None:
    """List the arms that work by name, with their limits and friction."""
    from fpid_pin.cli.arms import arms_table
    from fpid_pin.cli.screen import screen

    screen().print(arms_table())


@app.command()
def inspect(
    arm: ArmName,
    lock: Locks = None,
    bandwidth: Annotated[float, typer.Option(help="Of the gains [rad/s].")] = 10.0,
    step: Annotated[float, typer.Option(help="Sampling step [s].")] = 1e-3,
    picture: Annotated[Path | None, typer.Option(help="Draw it: .svg, .png or .pdf.")] = None,
    keep: Tip = None,
    package_dir: PackageDirs = None,
    tool: Tool = None,
) -> None:
    """Say what there is to know of an arm: limits, inertia, suggested gains, margins."""
    from fpid_pin.cli.arm_argument import arm_table
    from fpid_pin.cli.inspect import run_inspect

    table = arm_table(arm, lock or (), keep, package_dir or (), tool)
    run_inspect(table, bandwidth, step, picture)


@app.command()
def init(
    arm: ArmName,
    out: Annotated[Path, typer.Option(help="The file to write.")] = Path("config.toml"),
    lock: Locks = None,
    keep: Tip = None,
    package_dir: PackageDirs = None,
    tool: Tool = None,
) -> None:
    """Write a configuration for an arm that `compare` runs as it is."""
    from fpid_pin.cli.arm_argument import arm_table
    from fpid_pin.cli.init import run_init

    run_init(arm, arm_table(arm, lock or (), keep, package_dir or (), tool), out)


@app.command()
def view(
    files: Annotated[list[Path], typer.Argument(metavar="RUN.npz ...", help="Recorded runs.")],
    html: Annotated[Path | None, typer.Option(help="Write one page that opens anywhere.")] = None,
    caption: Annotated[list[str] | None, typer.Option(help="A caption a run; repeat.")] = None,
    fps: Annotated[float, typer.Option(help="Frames a second.")] = 30.0,
    browser: Annotated[bool, typer.Option(help="Open the browser.")] = True,
    port: Annotated[int | None, typer.Option(help="Of the view, on 127.0.0.1.")] = None,
) -> None:
    """Show recorded runs in meshcat: in a browser, or as one self-contained page."""
    from fpid_pin.cli.view import run_view

    run_view(
        files, html=html, captions=caption or (), fps=fps,
        browser=browser, port=port,
    )  # fmt: skip


@app.command()
def playground(
    config: ConfigFile,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("playground.html"),
    controller: Annotated[str | None, typer.Option(help="Which controller; none: all.")] = None,
    allow_import: AllowImport = False,
) -> None:
    """Write one page with sliders that simulates again as they move; it needs no network."""
    from fpid_pin.cli.playground import run_playground

    run_playground(config, html, controller)


@app.command()
def live(
    config: ConfigFile,
    controller: Annotated[str | None, typer.Option(help="Which controller, by name.")] = None,
    duration: Annotated[float | None, typer.Option(help="[s]; none: until Ctrl-C.")] = None,
    fps: Annotated[float, typer.Option(help="Frames a second.")] = 40.0,
    browser: Annotated[bool, typer.Option(help="Open the browser.")] = True,
    port: Annotated[int | None, typer.Option(help="Of the view, on 127.0.0.1.")] = None,
    joint: Annotated[str | None, typer.Option(help="Joint that a key press pushes.")] = None,
    push: Annotated[float | None, typer.Option(help="Torque of a push [N m].")] = None,
    baseline: Annotated[float, typer.Option(help="Run so long without the view first [s].")] = 0.0,
    allow_import: AllowImport = False,
) -> None:
    """Run the control loop in real time and watch it; key presses push a joint."""
    from fpid_pin.cli.live import run_live

    run_live(
        config, controller=controller, duration=duration, fps=fps, browser=browser, port=port,
        joint=joint, push=push, baseline=baseline,
    )  # fmt: skip


@app.command()
def export(
    config: ConfigFile,
    out: Annotated[Path, typer.Option("--out", help="A new folder.")],
    controller: Annotated[str | None, typer.Option(help="Which controller, by name.")] = None,
    horizon: Annotated[float, typer.Option(help="Longest time that it will run [s].")] = 3600.0,
    ticks: Annotated[int, typer.Option(help="Length of its test vectors.")] = 2000,
    allow_import: AllowImport = False,
) -> None:
    """Write a controller as C99 for a robot, with test vectors that prove it."""
    from fpid_pin.cli.export import run_export

    run_export(config, out, controller, horizon, ticks)
