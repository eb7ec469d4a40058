"""The driver of a campaign: what is missing is simulated, what comes back is recorded."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from pathlib import Path

from fpid_pin import checks, own_code
from fpid_pin.campaign import stopping
from fpid_pin.campaign.chunk import Job
from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.execution import carry_out, pieces
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.campaign.scenarios import BLOCK
from fpid_pin.campaign.study import Study
from fpid_pin.exceptions import ArgumentError
from fpid_pin.files import locked
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.entry import executor_of, warm
from fpid_pin.simulation.workers import check_workers

#: Runs of a task, and pieces that wait for each worker: none is idle while its last is recorded.
CHUNK, AHEAD = 64, 2


def run(
    study: Study,
    ledger: str | Path,
    runs: int,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int = CHUNK,
    until: str | Callable[[CampaignData], bool] | None = None,
    progress: ProgressCallback | None = None,
) -> CampaignData:
    """Simulate runs 0 to `runs` - 1 of a campaign and record them; go on where a ledger ends.

    Parameters
    ----------
    study
        The campaign.
    ledger
        Its file; made where there is none.
    runs
        How many there are to be. More than are there: those are kept.
    executor
        Any `concurrent.futures.Executor`; it stays open.
    workers
        Or so many of our own: threads for compiled laws and dynamics, else processes. Neither: one
        run after another.
    chunk
        Runs of a task. Neither it nor the executor changes a bit of what is recorded.
    until
        When it is enough: ``"success +- 0.01"``, ``"A - B"`` (see `stopping.parse`) or a function.
        It is asked about the first 256, 512, ... runs as they are there; where it says so the
        campaign ends with them, however many were under way.
    progress
        Called now and then with a `Progress`.

    Returns
    -------
    CampaignData
        All runs.

    Raises
    ------
    ArgumentError, FileFormatError
        Before anything is simulated: see `Ledger`.
    """
    checks.instance("study", study, Study, "a Study")
    runs = checks.integer("runs", runs, low=1)
    chunk = checks.integer("chunk", chunk, low=1)
    check_workers(executor, workers)
    points = study.scenarios.points
    if points is not None and runs > len(points):  # type: ignore[arg-type]
        raise ArgumentError("runs", f"at most {len(points)} (the points given)", runs)  # type: ignore[arg-type]
    rule = stopping.parse(until, study.names) if isinstance(until, str) else until
    nominal, laws = [study.experiment] * len(study.laws), study.laws
    job = Job(study, own=own_code.loaded())
    with (
        locked(ledger),
        Ledger(ledger, study) as book,
        executor_of(executor, workers, nominal, laws) as pool,
    ):
        recorded = book.recorded()
        runs = max(runs, max(recorded, default=-1) + 1)
        book.plan(runs)
        missing = [k for k in range(runs) if k not in recorded]
        if missing and pool is not None:
            # So that workers find the kernels compiled.
            warm(nominal, laws)
        window = AHEAD * workers_of(pool)
        watch = _Watch(book, rule)
        if watch.ended(recorded):
            return book.data()
        for done in carry_out(job, pieces(missing, chunk), pool, window):
            book.record(done)
            recorded.update(range(done.first, done.first + len(done.ends)))
            if progress is not None:
                progress(Progress(len(recorded) / runs))
            if watch.ended(recorded):
                break
        return book.data()


class _Watch:
    """Asks a rule about the first runs, each multiple of `BLOCK` once and in order.

    What it sees does not depend on when chunks come back.
    """

    def __init__(self, book: Ledger, until: Callable[[CampaignData], bool] | None) -> None:
        self._book, self._until, self._next = book, until, BLOCK
        self._whole = 0

    def ended(self, recorded: set[int]) -> bool:
        """Return whether the rule is content, having dropped what was recorded beyond."""
        if self._until is None:
            return False
        while self._whole in recorded:
            self._whole += 1
        while self._next <= self._whole:
            if self._until(self._book.data(self._next)):
                self._book.keep(self._next)
                return True
            self._next += BLOCK
        return False


def workers_of(executor: Executor | None) -> int:
    """Return how many tasks an executor works on at once, where it tells."""
    return int(getattr(executor, "_max_workers", 2))


def load(ledger: str | Path) -> CampaignData:
    """Return what a ledger holds, also while its campaign runs: runs up to the first missing one.

    Raises
    ------
    FileFormatError
        Not a ledger, or a damaged one.
    """
    with Ledger(ledger) as book:
        return book.data()
