"""Whose processors a command uses: ``--workers``, ``--dask``, or this process."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import AbstractContextManager

from fpid_pin import checks
from fpid_pin.campaign import dask_executor
from fpid_pin.control import Controller
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation import Experiment
from fpid_pin.simulation.entry import executor_of


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


def executor_for(
    workers: int | None,
    dask: str | None,
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
) -> AbstractContextManager[Executor | None]:
    """Give workers of our own, a scheduler's executor, or None for this process.

    Parameters
    ----------
    workers
        Number of threads, or of processes where a law or the dynamics are not compiled.
    dask
        Or address of a scheduler.
    experiments, controllers
        What is to be simulated.
    """
    check_means(workers, dask)
    if dask is not None:
        return dask_executor(dask)
    return executor_of(None, workers, experiments, controllers)
