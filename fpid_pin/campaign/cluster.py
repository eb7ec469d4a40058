"""Executors of a Dask cluster, and one on this machine for trying it out (extra ``cluster``)."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from functools import partial
from typing import Any

from fpid_pin import checks, own_code
from fpid_pin._version import __version__
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.resources import needed
from fpid_pin.simulation.workers import without_ctrl_c

#: Scheduler and first worker answer within this [s], or are none: with what else it takes, 10 s.
PATIENCE = 8.0
_LOOPBACK = "127.0.0.1"


@contextmanager
def dask_executor(address: str, *, patience: float = PATIENCE) -> Iterator[Executor]:
    """Give an executor for ``executor=`` whose tasks go to the workers of a Dask scheduler.

    Parameters
    ----------
    address
        ``"tcp://127.0.0.1:8786"``; ``"tls://..."`` with the certificates of Dask's configuration.
        Whoever reaches a scheduler without TLS can run code on its workers: beyond one machine use
        TLS.
    patience
        How long scheduler and first worker are waited for [s].

    Raises
    ------
    FpidError
        No ``distributed`` here; no scheduler or worker that answers; workers without the package,
        or with another version of it, each named with its own.
    """
    checks.number("patience", patience, above=0.0)
    distributed = needed("distributed", "cluster")
    try:
        client = distributed.Client(address, timeout=patience, set_as_default=False)
    except (OSError, TimeoutError, ValueError, TypeError) as error:
        told = f"none ({str(error).splitlines()[0]})" if str(error) else "none"
        expected = f"a Dask scheduler that answers within {patience:g} s"
        raise ArgumentError(f"dask {address}", expected, told) from None
    try:
        _prepare_workers(client, address, patience)
        # Tried again here, and not by the scheduler.
        executor: Any = client.get_executor(pure=False, retries=0)
        # As the executors of Python tell it.
        executor._max_workers = sum(client.nthreads().values())
        yield executor
    finally:
        client.close(timeout=patience)


def _prepare_workers(client: Any, address: str, patience: float) -> None:
    """Require workers of this version, and run on them, now or later, what was run here."""
    try:
        client.wait_for_workers(1, timeout=patience)
    except TimeoutError:
        expected = f"a worker within {patience:g} s"
        raise ArgumentError(f"dask {address}", expected, "none") from None
    # Not by name: a worker without the package could not find it.
    found = client.run(lambda: __import__("fpid_pin").__version__, on_error="return")
    for worker, version in found.items():
        if version != __version__:
            got = "none" if isinstance(version, Exception) else str(version)
            raise FpidError(
                f"dask worker {worker}: expected fpid_pin {__version__}, as here, got {got}"
            )
    if own_code.loaded():
        client.register_worker_callbacks(partial(own_code.load_again, own_code.loaded()))


@contextmanager
def local_cluster(workers: int = 2) -> Iterator[Any]:
    """Start a scheduler and `workers` workers of one thread; end them with the block.

    They listen on loopback only: whoever reaches a scheduler can run code on its workers.

    Yields
    ------
    distributed.LocalCluster
        Its ``scheduler_address`` is what `dask_executor` takes.

    Raises
    ------
    FpidError
        ``distributed`` is not installed.
    """
    workers = checks.integer("workers", workers, low=1)
    distributed = needed("distributed", "cluster")
    # Without a dashboard, too, there is a page of each, on every interface if not told where.
    page = f"{_LOOPBACK}:0"
    with without_ctrl_c():
        cluster = distributed.LocalCluster(
            workers, threads_per_worker=1, host=_LOOPBACK, dashboard_address=page,
            worker_dashboard_address=page, silence_logs=40,
        )  # fmt: skip
    with cluster:
        yield cluster
