"""The bodies of ``fpid-pin campaign ...``: run, go on, export, replay, attack, report."""

from __future__ import annotations

import threading
from concurrent.futures import Executor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np

from fpid_pin import campaign, checks
from fpid_pin.campaign import CampaignData, Replay, Study, dask_executor
from fpid_pin.campaign.data import METRICS, OUTCOMES
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.cli.campaign_plan import read_campaign
from fpid_pin.cli.config import load
from fpid_pin.cli.executors import check_means
from fpid_pin.cli.names import file_names
from fpid_pin.cli.progress import progress_bar
from fpid_pin.cli.screen import print_table, say, screen
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import kind_of, require_file
from fpid_pin.progress import Progress
from fpid_pin.text import visible


@dataclass(frozen=True)
class Means:
    """What a campaign is simulated by.

    Parameters
    ----------
    workers
        Threads here, or processes (see `fpid_pin.campaign.run`).
    dask
        Or the address of a scheduler. Neither: this process.
    chunk
        Runs of a task.
    """

    workers: int | None = None
    dask: str | None = None
    chunk: int = 64

    def __post_init__(self) -> None:
        check_means(self.workers, self.dask)
        checks.integer("--chunk", self.chunk, low=1)

    def executor(self) -> AbstractContextManager[Executor | None]:
        """Return what gives the scheduler's executor, or None."""
        return nullcontext() if self.dask is None else dask_executor(self.dask)


def run_campaign(config: Path, out: Path, runs: int | None, means: Means) -> None:
    """Simulate the campaign of a configuration, or go on with it where `out` holds it already."""
    plan = read_campaign(load(config))
    _carry_out(plan.study, out, plan.runs if runs is None else runs, means)


def resume_campaign(ledger: Path, runs: int | None, means: Means) -> None:
    """Go on with a campaign by its ledger alone."""
    with Ledger(ledger) as book:
        study, planned = book.study(), book.planned
    _carry_out(study, ledger, planned if runs is None else runs, means)


def _carry_out(study: Study, ledger: Path, runs: int, means: Means) -> None:
    console = screen(error=True)
    if runs < 1:
        raise ArgumentError("--runs", "a whole number >= 1", runs)
    many = f"{runs} plants, {len(study.names)} controllers"
    say(console, f"{many}, dynamics {study.experiment.dynamics}, ledger {ledger}")
    try:
        with means.executor() as executor, progress_bar("campaign") as bar:
            data = campaign.run(
                study, ledger, runs, executor=executor, workers=means.workers, chunk=means.chunk,
                progress=bar,
            )  # fmt: skip
    except KeyboardInterrupt:
        say(console, f"{ledger}: `fpid-pin campaign resume {ledger}` goes on from here")
        raise
    show(data, ledger)


def show(data: CampaignData, ledger: Path) -> None:
    """Print a line a controller: how its runs ended, and the middle of its figures."""
    from rich.table import Table
    from rich.text import Text

    table = Table(title=f"{data.runs} plants; medians of successes", box=None, padding=(0, 1))
    for head in ("controller", *OUTCOMES, *(f"{name} [{unit}]" for name, unit in METRICS.items())):
        # As text: brackets are markup in a table's heads.
        table.add_column(Text(head), justify="left" if head == "controller" else "right")
    for k, name in enumerate(data.controllers):
        ends = [str(np.sum(data.outcome[:, k] == end)) for end in OUTCOMES]
        well = data.success[:, k]
        middle = [
            f"{np.median(values[well, k]):.4g}" if well.any() else "-"
            for values in data.metrics.values()
        ]
        table.add_row(Text(visible(name)), *ends, *middle)
    console = screen()
    print_table(console, table)
    say(console, f"{ledger}: campaign export, replay and report read it")


def export_campaign(ledger: Path, out: Path) -> None:
    """Write a ledger's table as CSV or Parquet."""
    path = campaign.export(campaign.load(ledger), out)
    say(screen(), f"{path}: {path.stat().st_size / 1e6:.2f} MB")


def replay_campaign(ledger: Path, run: int, controller: str | None, html: Path) -> None:
    """Simulate a run again and write a page with it and its nominal twin."""
    require_file(html)
    again = campaign.replay(ledger, run, controller)
    console = screen()
    for label, value in again.sample.items():
        say(console, f"  {label}: {value:.6g}")
    say(
        console,
        f"run {run}, {again.controller}: {again.again.outcome} {again.again.cause}".rstrip(),
    )
    say(console, f"  dynamics: {again.run.meta['experiment']['dynamics']}")
    for name, before, now in zip(METRICS, again.recorded.figures, again.again.figures, strict=True):
        say(console, f"  {name}: {now!r}, recorded {before!r}")
    told = "the same bits" if again.exact else "NOT the same bits: recorded by another machine?"
    say(console, f"as the ledger has it: {told}")
    path = _write_replay(again, html)
    say(console, f"{path}: {path.stat().st_size / 1e6:.2f} MB, opens in any browser")


def attack_campaign(
    config: Path, out: Path, population: int, generations: int, means: Means
) -> None:
    """Search the worst plants of a configuration's controllers."""
    if kind_of(out) is not None:
        raise ArgumentError("--out", "a new file", f"{out}, which is there")
    plan = read_campaign(load(config))
    with means.executor() as executor, progress_bar("attack") as bar:
        data = campaign.attack(
            plan.study, out, population=population, generations=generations,
            executor=executor, workers=means.workers, progress=bar,
        )  # fmt: skip
    console = screen()
    for k, name in enumerate(data.controllers):
        cause = f" ({data.cause[k, k]})" if data.cause[k, k] else ""
        say(
            console, f"{name}: {data.outcome[k, k]}{cause}, RMS {data.metrics['rms'][k, k]:.4g} rad"
        )
        for label, unit, value in zip(data.parameters, data.units, data.samples[k], strict=True):
            say(console, f"  {label}: {value:.6g} {unit}")
        say(console, f'  fpid-pin campaign replay {out} --run {k} --controller "{name}"')


def report_campaign(ledger: Path, html: Path, replays: bool) -> None:
    """Write the report of a campaign, and beside it replays of the runs that it lists as worst."""
    require_file(html)
    data = campaign.load(ledger)
    folder = html.with_name(f"{html.stem}-replays")
    stems = dict(zip(data.controllers, file_names([[c] for c in data.controllers]), strict=True))

    def link(run: int, controller: str) -> str | None:
        column = data.controllers.index(controller)
        if not replays or data.outcome[run, column] == "failed":
            return None
        page = folder / f"run-{run}-{stems[controller]}.html"
        _write_replay(campaign.replay(ledger, run, controller), page)
        return quote(f"{folder.name}/{page.name}")

    with progress_bar("report") as bar:
        bar(Progress(0.0))
        path = campaign.report_html(data, html, replay_link=link)
    say(screen(), f"{path}: {path.stat().st_size / 1e6:.2f} MB, opens in any browser")
    if folder.is_dir():
        say(screen(), f"{folder}: the replays that it leads to")


def _write_replay(again: Replay, path: Path) -> Path:
    from fpid_pin.view import export_html

    captions = [f"run {again.number}, {again.controller}", "nominal plant"]
    return export_html([again.run, again.nominal], path, captions=captions)


def keep_cluster(workers: int) -> None:
    """Start a cluster on this machine and say where it is, until Ctrl-C."""
    with campaign.local_cluster(workers) as cluster:
        console = screen()
        say(console, f"--dask {cluster.scheduler_address}")
        say(console, f"{workers} workers, on this machine only; Ctrl-C ends them")
        threading.Event().wait()
