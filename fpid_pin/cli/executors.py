"""Whose processors a command uses: ``--workers``, ``--dask``, or this process."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from fpid_pin import checks
from fpid_pin.campaign import dask_executor
from fpid_pin.exceptions import ArgumentError
from fpid_pin.tuning import WorkerPool


def check_means(workers: int | None, dask: str | None) -> None:
    """Check that one of ``--workers`` and ``--dask`` is given at most.

    Raises
    ------
    ArgumentError
        Both, or no whole number of workers from 1 on.
    """
    if workers is not None:
        checks.integer("--workers", workers, low=1)
        if dask is not None:
            raise ArgumentError("--dask", "--workers or --dask, not both", "both")


@contextmanager
def executor_for(
    workers: int | None, dask: str | None, *, retries: int = 3
) -> Iterator[Executor | None]:
    """Give worker processes, a scheduler's executor, or None for this process.

    Parameters
    ----------
    workers
        Number of processes.
    dask
        Or address of a scheduler.
    retries
        How often one task may lose its worker process.
    """
    check_means(workers, dask)
    if dask is not None:
        with dask_executor(dask) as executor:
            yield executor
    elif workers is not None:
        with WorkerPool(workers, retries=retries) as pool:
            yield pool
    else:
        yield None
