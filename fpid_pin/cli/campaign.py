"""The subcommands of `fpid-pin campaign`; what they need is imported when they are called."""

from __future__ import annotations

import dataclasses
import threading
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any
from urllib.parse import quote

import typer

from fpid_pin import own_code
from fpid_pin.cli.options import AllowImport, ConfigFile, Dask, Workers
from fpid_pin.cli.output import file_names, results_path
from fpid_pin.cli.screen import print_table, progress_bar, say, say_written
from fpid_pin.exceptions import ArgumentError, ConfigError, FpidError
from fpid_pin.files import kind_of, require_file
from fpid_pin.progress import Progress

if TYPE_CHECKING:
    from fpid_pin.campaign import Replay, Study
    from fpid_pin.cli.configuration import Config

app = typer.Typer(
    help="The same controllers on thousands of different plants.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

LedgerFile = Annotated[Path, typer.Argument(metavar="LEDGER", help="The ledger of a campaign.")]
Runs = Annotated[int | None, typer.Option(help="Number of plants; recorded ones are kept.")]
Chunk = Annotated[int, typer.Option(help="Plants in one task.")]
NewLedger = Annotated[Path | None, typer.Option("--out", help="The ledger to write.")]


@app.command()
def run(
    config: ConfigFile,
    runs: Runs = None,
    out: NewLedger = None,
    workers: Workers = None,
    dask: Dask = None,
    chunk: Chunk = 64,
    allow_import: AllowImport = False,
) -> None:
    """Simulate a campaign, or continue where its ledger ends."""
    from fpid_pin.cli.configuration import load

    executor = executor_of(workers, dask)
    study, planned = read_campaign(load(config, allow_import))
    ledger = out or results_path(config, "-campaign.sqlite")
    _carry_out(study, ledger, planned if runs is None else runs, executor, workers, chunk)


@app.command()
def resume(
    ledger: LedgerFile,
    runs: Runs = None,
    workers: Workers = None,
    dask: Dask = None,
    chunk: Chunk = 64,
    allow_import: AllowImport = False,
) -> None:
    """Continue a campaign, also with more plants than before."""
    from fpid_pin.campaign.ledger import Ledger

    own_code.allowed.set(allow_import)
    executor = executor_of(workers, dask)
    with Ledger(ledger) as book:
        study, planned = book.study(), book.planned
    _carry_out(study, ledger, planned if runs is None else runs, executor, workers, chunk)


def _carry_out(
    study: Study, ledger: Path, runs: int, executor: AbstractContextManager[Any],
    workers: int | None, chunk: int,
) -> None:  # fmt: skip
    from fpid_pin import campaign

    many = f"{runs} plants, {len(study.controllers)} controllers"
    say(f"{many}, dynamics {study.experiment.dynamics}, ledger {ledger}", error=True)
    try:
        with executor as pool, progress_bar("campaign") as bar:
            data = campaign.run(
                study, ledger, runs, executor=pool, workers=workers, chunk=chunk,
                progress=bar,
            )  # fmt: skip
    except KeyboardInterrupt:
        say(f"{ledger}: `fpid-pin campaign resume {ledger}` goes on from here", error=True)
        raise
    say(*data.answer)
    print_table(data.medians(), f"{data.runs} plants; medians, lost ones as the worst")
    say(f"{ledger}: campaign export, replay and report read it")


def read_campaign(config: Config) -> tuple[Study, int]:
    """Check the table ``[campaign]``; return the study, and how many plants there are to be."""
    from fpid_pin.campaign.study import CampaignTable, Scenarios, Study
    from fpid_pin.cli.configuration import moved, read_table

    given = config.campaign.get("controllers")
    names = given if isinstance(given, list) else list(config.controllers)
    numbered = {f"controllers.{k}": name for k, name in enumerate(names)}
    table = read_table(config, "campaign", CampaignTable, numbered)
    experiment = dataclasses.replace(config.experiment, dynamics=table.dynamics)
    laws = {name: config.controllers[name] for name in names}
    scenarios = Scenarios(table.uncertain, table.sampling, table.seed, table.points)
    try:
        return Study(experiment, laws, scenarios, config.title, table.success), table.runs
    except FpidError as error:
        raise ConfigError.of(config.path, [moved(error, "campaign")]) from None


def executor_of(workers: int | None, dask: str | None) -> AbstractContextManager[Any]:
    """Give a scheduler's executor, or None: `workers` are then started here; both are refused."""
    from fpid_pin import checks
    from fpid_pin.campaign import dask_executor

    if workers is not None:
        checks.integer("--workers", workers, low=1)
    if workers is not None and dask is not None:
        raise ArgumentError("--dask", "--workers or --dask, not both", "both")
    return nullcontext() if dask is None else dask_executor(dask)


@app.command()
def export(
    ledger: LedgerFile,
    out: Annotated[Path, typer.Option("--out", help="A .csv or .parquet file.")],
) -> None:
    """Write the ledger as a table."""
    from fpid_pin import campaign

    say_written(campaign.export(campaign.load(ledger), out))


@app.command()
def replay(
    ledger: LedgerFile,
    run: Annotated[int, typer.Option(help="Number of the plant.")],
    controller: Annotated[str | None, typer.Option(help="Controller; default: the first.")] = None,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("replay.html"),
    save: Annotated[
        Path | None, typer.Option(help="Also save the run as .npz, for `view`.")
    ] = None,
    allow_import: AllowImport = False,
) -> None:
    """Simulate one run again, next to the same run of the nominal arm."""
    from fpid_pin import campaign

    own_code.allowed.set(allow_import)
    require_file(html)
    again = campaign.replay(ledger, run, controller)
    say(*str(again).splitlines())
    say_written(_write_replay(again, html))
    if save is not None:
        say_written(again.run.save(save))


@app.command()
def attack(
    config: ConfigFile,
    out: NewLedger = None,
    population: Annotated[int, typer.Option(help="Plants in a generation.")] = 32,
    generations: Annotated[int, typer.Option(help="Number of generations.")] = 40,
    workers: Workers = None,
    dask: Dask = None,
    allow_import: AllowImport = False,
) -> None:
    """Search the worst plant for each controller."""
    from fpid_pin import campaign
    from fpid_pin.cli.configuration import load

    out = out or results_path(config, "-attack.sqlite")
    if kind_of(out) is not None:
        raise ArgumentError("--out", "a new file", f"{out}, which is there")
    executor = executor_of(workers, dask)
    study, _ = read_campaign(load(config, allow_import))
    with executor as pool, progress_bar("attack") as bar:
        data = campaign.attack(
            study, out, population=population, generations=generations, executor=pool,
            workers=workers, progress=bar,
        )  # fmt: skip
    for k, name in enumerate(data.controllers):
        cause = f" ({data.cause[k, k]})" if data.cause[k, k] else ""
        error = f"RMS {data.metrics['rms'][k, k]:.4g} {data.unit('rms')}"
        say(f"{name}: {data.outcome[k, k]}{cause}, {error}")
        for label, unit, value in zip(data.parameters, data.units, data.samples[k], strict=True):
            say(f"  {label}: {value:.6g} {unit}")
        say(f'  fpid-pin campaign replay {out} --run {k} --controller "{name}"')


@app.command()
def report(
    ledger: LedgerFile,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"),
    no_replays: Annotated[
        bool, typer.Option("--no-replays", help="Write no replays of the worst runs.")
    ] = False,
    allow_import: AllowImport = False,
) -> None:
    """Write a page with success rates, distributions and the worst runs."""
    from fpid_pin import campaign

    own_code.allowed.set(allow_import)
    require_file(html)
    data = campaign.load(ledger)
    folder = html.with_name(f"{html.stem}-replays")
    stems = dict(zip(data.controllers, file_names([[c] for c in data.controllers]), strict=True))

    def link(run: int, controller: str) -> str | None:
        if no_replays or data.outcome[run, data.controllers.index(controller)] == "failed":
            return None
        page = folder / f"run-{run}-{stems[controller]}.html"
        _write_replay(campaign.replay(ledger, run, controller), page)
        return quote(f"{folder.name}/{page.name}")

    with progress_bar("report") as bar:
        bar(Progress(0.0))
        path = campaign.report_html(data, html, replay_link=link)
    say_written(path)
    if folder.is_dir():
        say(f"{folder}: the replays that it leads to")


def _write_replay(again: Replay, path: Path) -> Path:
    from fpid_pin.view import export_html

    captions = [f"run {again.number}, {again.controller}", "nominal plant"]
    return export_html([again.run, again.nominal], path, captions=captions)


@app.command()
def cluster(
    workers: Annotated[int, typer.Option(help="Number of workers, one thread each.")] = 2,
) -> None:
    """Run a Dask cluster on this machine, until Ctrl-C."""
    from fpid_pin import campaign

    with campaign.local_cluster(workers) as started:
        say(f"--dask {started.scheduler_address}")
        say(f"{workers} workers, on this machine only; Ctrl-C ends them")
        threading.Event().wait()
