"""The subcommands of `fpid-pin campaign`: their arguments, and whom they call."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from fpid_pin.cli.options import AllowImport, ConfigFile, Dask, Workers

app = typer.Typer(
    help="The same controllers on thousands of other plants, recorded and resumable.",
    no_args_is_help=True,
    rich_markup_mode=None,
)

LedgerFile = Annotated[Path, typer.Argument(metavar="LEDGER", help="Of a campaign.")]
Runs = Annotated[int | None, typer.Option(help="Plants; those that are there are kept.")]
Chunk = Annotated[int, typer.Option(help="Plants of a task.")]
NewLedger = Annotated[Path | None, typer.Option("--out", help="The ledger.")]


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
    """Simulate the campaign of a configuration; where the ledger holds it already, go on."""
    from fpid_pin.cli.campaign import Means, run_campaign

    means = Means(workers, dask, chunk)
    run_campaign(config, out or _ledger(config, "campaign"), runs, means)


@app.command()
def resume(
    ledger: LedgerFile,
    runs: Runs = None,
    workers: Workers = None,
    dask: Dask = None,
    chunk: Chunk = 64,
    allow_import: AllowImport = False,
) -> None:
    """Go on with a campaign, also to more plants than were asked for at first."""
    from fpid_pin.cli.campaign import Means, resume_campaign

    resume_campaign(ledger, runs, Means(workers, dask, chunk))


@app.command()
def export(
    ledger: LedgerFile,
    out: Annotated[Path, typer.Option("--out", help="A .csv or .parquet file.")],
) -> None:
    """Write a ledger as a table, a row a plant and controller."""
    from fpid_pin.cli.campaign import export_campaign

    export_campaign(ledger, out)


@app.command()
def replay(
    ledger: LedgerFile,
    run: Annotated[int, typer.Option(help="Number of the plant.")],
    controller: Annotated[str | None, typer.Option(help="By name; none: the first.")] = None,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("replay.html"),
    allow_import: AllowImport = False,
) -> None:
    """Simulate a run again exactly, and show it beside its nominal twin."""
    from fpid_pin.cli.campaign import replay_campaign

    replay_campaign(ledger, run, controller, html)


@app.command()
def attack(
    config: ConfigFile,
    out: NewLedger = None,
    population: Annotated[int, typer.Option(help="Plants of a generation.")] = 32,
    generations: Annotated[int, typer.Option(help="Generations.")] = 40,
    workers: Workers = None,
    dask: Dask = None,
    allow_import: AllowImport = False,
) -> None:
    """Search the plant that hurts each controller most; what is found can be replayed."""
    from fpid_pin.cli.campaign import Means, attack_campaign

    means = Means(workers, dask)
    attack_campaign(config, out or _ledger(config, "attack"), population, generations, means)


@app.command()
def report(
    ledger: LedgerFile,
    html: Annotated[Path, typer.Option(help="The page to write.")] = Path("report.html"),
    no_replays: Annotated[
        bool, typer.Option("--no-replays", help="Of the worst runs, none beside it.")
    ] = False,
    allow_import: AllowImport = False,
) -> None:
    """Write a page with success rates, distributions, sensitivities and the worst runs."""
    from fpid_pin.cli.campaign import report_campaign

    report_campaign(ledger, html, not no_replays)


@app.command()
def cluster(
    workers: Annotated[int, typer.Option(help="Of one thread each.")] = 2,
) -> None:
    """Start a Dask scheduler with workers on this machine's loopback, until Ctrl-C."""
    from fpid_pin.cli.campaign import keep_cluster

    keep_cluster(workers)


def _ledger(config: Path, what: str) -> Path:
    return Path("runs") / f"{config.stem}-{what}.sqlite"
