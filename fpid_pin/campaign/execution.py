"""Chunks of runs through any executor: a bounded window, and what to do when workers die."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    wait,
)
from dataclasses import dataclass

from fpid_pin.campaign.chunk import Done, Job, failed, run_chunk
from fpid_pin.exceptions import FpidError

#: Deaths of workers after which a chunk is taken apart, and its single run given up.
MOST_DEATHS = 3
_GONE = (
    "executor: expected one that lasts, got tasks cancelled, as where a scheduler is lost; what "
    "was recorded stays"
)
_BROKEN = (
    "executor: expected one that outlives its workers (fp.tuning.WorkerPool), got one that broke "
    "when a worker died; what was recorded stays"
)


@dataclass(frozen=True)
class Piece:
    """Runs `first` to `last` - 1, which have cost `deaths` workers; `alone` once they are suspects.

    A worker that dies may take its neighbours' pool with it. Only a piece with no other under way
    is known to be the one to blame.
    """

    first: int
    last: int
    deaths: int = 0
    alone: bool = False


def pieces(missing: Sequence[int], size: int) -> list[Piece]:
    """Cut runs into pieces of neighbours, at most `size` each.

    They end where multiples of `size` are, so that a campaign that goes on cuts as it did before.
    """
    found: list[Piece] = []
    for run in missing:
        if found and found[-1].last == run and run % size:
            found[-1] = Piece(found[-1].first, run + 1)
        else:
            found.append(Piece(run, run + 1))
    return found


def carry_out(
    job: Job, todo: Sequence[Piece], executor: Executor | None, window: int
) -> Iterator[Done]:
    """Simulate pieces and yield their results as they come, in no order.

    Parameters
    ----------
    job
        The campaign.
    todo
        What is to be done.
    executor
        None: this process.
    window
        Most pieces under way at once. A result is dropped once it was yielded.

    Raises
    ------
    FpidError
        The executor takes no more tasks.
    """
    if executor is None:
        for piece in todo:
            yield run_chunk(job, piece.first, piece.last)
        return
    waiting, suspects = deque(todo), deque[Piece]()
    flying: dict[Future[Done], Piece] = {}
    try:
        while waiting or suspects or flying:
            try:
                while waiting and not suspects and len(flying) < window:
                    _send(executor, job, waiting, flying)
                # Suspects go one by one, once nobody else is under way.
                if suspects and not flying:
                    _send(executor, job, suspects, flying)
            except BrokenExecutor:
                if not flying:
                    raise FpidError(_BROKEN) from None
            done = wait(flying, return_when=FIRST_COMPLETED).done
            # What there is comes before what was lost.
            for future in sorted(done, key=Future.cancelled):
                piece = flying.pop(future)
                deaths = _deaths(future)
                if not deaths:
                    yield future.result()
                    continue
                parts = _after(piece, deaths)
                suspects.extend(parts)
                if not parts:
                    yield _given_up(job, piece.first)
    finally:
        for future in flying:
            future.cancel()


def _send(
    executor: Executor, job: Job, queue: deque[Piece], flying: dict[Future[Done], Piece]
) -> None:
    """Send a queue's first piece; where the executor is broken it stays in the queue."""
    future = executor.submit(run_chunk, job, queue[0].first, queue[0].last)
    flying[future] = queue.popleft()


def _deaths(future: Future[Done]) -> int:
    """Return how many workers a task has cost."""
    try:
        error = future.exception()
    except CancelledError:
        # Nobody here cancels what is waited for.
        raise FpidError(_GONE) from None
    if isinstance(error, BrokenExecutor):
        return 1
    # Dask's scheduler tries again by itself before it says so. By name: it need not be there.
    return MOST_DEATHS if type(error).__name__ == "KilledWorker" else 0


def _after(piece: Piece, deaths: int) -> list[Piece]:
    """Return what is to be tried after a piece has cost so many more workers; nothing: give up."""
    first, last = piece.first, piece.last
    if not piece.alone:
        # Deaths in company do not count.
        return [Piece(first, last, alone=True)]
    total = piece.deaths + deaths
    if total < MOST_DEATHS:
        return [Piece(first, last, total, alone=True)]
    if last - first == 1:
        return []
    # Somebody in it is to blame, so that a part of several runs is taken apart at its first death.
    middle = (first + last) // 2
    halves = ((first, middle), (middle, last))
    return [Piece(a, b, MOST_DEATHS - 1 if b - a > 1 else 0, alone=True) for a, b in halves]


def _given_up(job: Job, run: int) -> Done:
    study = job.study
    end = failed(f"{MOST_DEATHS} workers died over it, one after the other")
    return Done(run, study.bound.samples(run, run + 1), [[end] * len(study.names)])
