"""A Dask scheduler and its workers on this machine's loopback, for trying a cluster out."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from fpid_pin import checks
from fpid_pin.exceptions import FpidError
from fpid_pin.extras import needed

#: Until the scheduler says where it listens [s].
_PATIENCE = 60.0
#: Left alone for so long [s], scheduler and workers end by themselves.
_FORGOTTEN = 3600
_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True)
class LocalCluster:
    """A running cluster.

    Attributes
    ----------
    address
        Of the scheduler.
    processes
        Ids: of the scheduler, then of the workers' keepers, which start a dead worker anew.
    """

    address: str
    processes: tuple[int, ...]


@contextmanager
def local_cluster(workers: int = 2) -> Iterator[LocalCluster]:
    """Start a scheduler and `workers` workers of one thread; end them with the block.

    They listen on loopback only: whoever reaches a scheduler can run code on its workers.

    Raises
    ------
    FpidError
        ``distributed`` is not installed, or the scheduler does not start.
    """
    workers = checks.integer("workers", workers, low=1)
    needed("distributed", "cluster")
    # One thread a process, as in our own pools.
    alone = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")
    started: list[subprocess.Popen[bytes]] = []

    def start(command: str, *options: str) -> None:
        arguments = [sys.executable, "-m", f"distributed.cli.dask_{command}", *options]
        quiet = subprocess.DEVNULL
        started.append(subprocess.Popen(arguments, stdout=quiet, stderr=quiet, env=alone))

    with tempfile.TemporaryDirectory(prefix="fpid_pin-cluster-") as folder:
        file = Path(folder, "scheduler.json")
        # Without a dashboard, too, there is a page of each, on every interface if not told where.
        pages = ("--no-dashboard", "--dashboard-address", f"{_LOOPBACK}:0")
        here = ("--host", _LOOPBACK, "--scheduler-file", str(file), *pages)
        try:
            start("scheduler", *here, "--port", "0", "--idle-timeout", str(_FORGOTTEN))
            address = _address(file, started[0])
            for _ in range(workers):
                start("worker", *here, "--nthreads", "1", "--death-timeout", "60",
                      "--local-directory", folder)  # fmt: skip
            yield LocalCluster(address, tuple(process.pid for process in started))
        finally:
            # Workers first: they would look for their scheduler.
            for process in reversed(started):
                process.terminate()
            for process in started:
                try:
                    process.wait(15.0)
                except subprocess.TimeoutExpired:
                    process.kill()
                    process.wait()


def _address(file: Path, scheduler: subprocess.Popen[bytes]) -> str:
    end = time.monotonic() + _PATIENCE
    while time.monotonic() < end and scheduler.poll() is None:
        try:
            return str(json.loads(file.read_text())["address"])
        except (OSError, ValueError):
            time.sleep(0.1)
    raise FpidError(f"cluster: expected a scheduler within {_PATIENCE:g} s, got none")
