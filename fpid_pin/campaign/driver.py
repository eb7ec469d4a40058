"""The driver of a campaign: what is missing is simulated, what comes back is recorded."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from itertools import groupby
from pathlib import Path

import numpy as np

from fpid_pin import checks
from fpid_pin.campaign.chunk import run_chunk
from fpid_pin.campaign.data import CampaignData
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.campaign.study import Study
from fpid_pin.exceptions import ArgumentError, WorkersDied
from fpid_pin.files import locked
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.entry import executor_of, warm
from fpid_pin.simulation.workers import spread

#: Runs of a task.
CHUNK = 64


def run(
    study: Study,
    ledger: str | Path,
    runs: int,
    *,
    executor: Executor | None = None,
    workers: int | None = None,
    chunk: int = CHUNK,
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
    WorkersDied
        Workers died twice over the same runs, which are named; what was recorded stays.
    """
    checks.instance("study", study, Study, "a Study")
    runs = checks.integer("runs", runs, low=1)
    chunk = checks.integer("chunk", chunk, low=1)
    points = study.scenarios.points
    if points is not None and runs > len(np.asarray(points)):
        raise ArgumentError("runs", f"at most {len(np.asarray(points))} (the points given)", runs)
    nominal, laws = [study.experiment] * len(study.laws), study.laws
    with (
        executor_of(executor, workers, nominal, laws) as pool,
        locked(ledger),
        Ledger(ledger, study, runs) as book,
    ):
        recorded = book.recorded()
        missing = [k for k in range(book.planned) if k not in recorded]
        if missing and pool is not None:
            # So that workers find the kernels compiled.
            warm(nominal, laws)
        todo, done = pieces(missing, chunk), len(recorded)
        try:
            for k, results in spread(run_chunk, [(study, *piece) for piece in todo], pool):
                book.record(todo[k][0], results)
                done += len(results.ends)
                if progress is not None:
                    progress(Progress(done / (len(recorded) + len(missing))))
        except WorkersDied as error:
            first, last = todo[error.task]
            raise WorkersDied(f"runs {first} to {last - 1}: {error}", error.task) from None
        return book.data()


def pieces(missing: Sequence[int], size: int) -> list[tuple[int, int]]:
    """Cut runs into pieces of neighbours, at most `size` each: (first, last + 1).

    They end where multiples of `size` are, so that a campaign that goes on cuts as it did before.
    """
    cut = groupby(enumerate(missing), lambda item: (item[1] - item[0], item[1] // size))
    several = [[run for _, run in group] for _, group in cut]
    return [(group[0], group[-1] + 1) for group in several]


def load(ledger: str | Path) -> CampaignData:
    """Return what a ledger holds, also while its campaign runs: runs up to the first missing one.

    Raises
    ------
    FileFormatError
        Not a ledger, or a damaged one.
    """
    with Ledger(ledger) as book:
        return book.data()
