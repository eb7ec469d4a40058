"""How work is spread: over threads, over a cluster, or over processes of our own.

Processes are for what holds the interpreter's lock: Python laws, Pinocchio's dynamics.
"""

import multiprocessing
import os
import pickle
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent import futures
from concurrent.futures import Executor, Future
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import partial
from itertools import islice
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from fpid_pin import checks, own_code
from fpid_pin._version import __version__
from fpid_pin.checks import checked
from fpid_pin.control.law import Controller
from fpid_pin.exceptions import ArgumentError, FpidError, TuningError, WorkersDied
from fpid_pin.resources import keep_to_one_thread, needed
from fpid_pin.simulation.experiment import Experiment

T = TypeVar("T")

#: Tasks under way for each worker: none is idle while its last result is taken.
AHEAD = 2
#: A cluster's scheduler and first worker answer within this [s], or are none.
PATIENCE = 8.0


class WorkerPool(futures.ProcessPoolExecutor):
    """Worker processes for ``executor=``, wherever there is one.

    Where a worker dies, all tasks under way fail with `BrokenExecutor`, and the next task has new
    workers. These are spawned, not forked, use one thread each, and end when their parent does,
    however it ends.

    Parameters
    ----------
    workers
        Number of processes.

    Notes
    -----
    Spawned workers import the main script: it must start its work under
    ``if __name__ == "__main__":``.
    """

    def __init__(self, workers: int) -> None:
        super().__init__(
            checks.integer("workers", workers, low=1),
            mp_context=multiprocessing.get_context("spawn"),
            initializer=_prepare_worker,
            initargs=(own_code.loaded(),),
        )

    @property
    def processes(self) -> list[int]:
        """Process ids of the workers that run now."""
        return sorted(process.pid for process in self._workers())

    def _workers(self) -> list[Any]:
        # Not public before Python 3.14, which can only end them, not name them.
        return list((self._processes or {}).values())

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """See `concurrent.futures.Executor.submit`."""
        _require_importable((fn, args, kwargs))
        with without_ctrl_c():
            try:
                return super().submit(fn, *args, **kwargs)
            except futures.BrokenExecutor:
                # An executor that is broken stays so; made anew it has new workers.
                WorkerPool.__init__(self, workers_of(self))
                return super().submit(fn, *args, **kwargs)

    def __exit__(self, *fault: Any) -> None:
        if fault[0] is not None:
            # Nobody waits for results after a fault or Ctrl-C, and a task may last for minutes.
            for process in self._workers():
                process.terminate()
        self.shutdown(wait=True, cancel_futures=fault[0] is not None)


def _require_importable(task: Any) -> None:
    """Refuse what workers, which begin by importing the main script, would die over."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    if script is None and b"__main__" in pickle.dumps(task):
        raise TuningError(
            "workers: expected classes and functions of a module, got one that this session "
            "defines: write it into a file and import that, or use no workers"
        )
    if script is not None and not os.path.isfile(script):
        raise TuningError(f"workers: expected a script in a file, got {script}")


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Let processes that are started in this block hear no Ctrl-C: it is for their parent.

    A terminal sends it to them too, also while they import what they will need.
    """
    # It unblocks the signal where it starts, so that must have happened.
    resource_tracker.ensure_running()
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)


def _prepare_worker(own: list[str]) -> None:
    """Leave Ctrl-C to the parent, do not outlive it, and run the user's files that it has run."""
    own_code.load_again(own)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    keep_to_one_thread()
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # A parent killed by SIGKILL cannot say goodbye, and the pool's pipes stay open.
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="parent watch").start()


def check_workers(executor: Executor | None, workers: int | None) -> None:
    """Check that there are worker processes of one kind at most."""
    if workers is not None:
        checks.integer("workers", workers, low=1)
        if executor is not None:
            raise ArgumentError("workers", "workers or executor, not both", workers)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ArgumentError("executor", "an Executor", type(executor).__name__)


def executor_of(
    executor: Executor | None,
    workers: int | None,
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
) -> AbstractContextManager[Executor | None]:
    """Return the caller's executor, which stays open, or workers of our own, which are closed.

    Compiled work lets go of the interpreter's lock, so that threads share it out; a law in Python,
    or Pinocchio's dynamics, needs processes.
    """
    check_workers(executor, workers)
    if executor is not None or workers is None:
        return nullcontext(executor)
    holds = any(c.control is not None for c in controllers)
    holds = holds or any(e.dynamics == "pinocchio" for e in experiments)
    return WorkerPool(workers) if holds else futures.ThreadPoolExecutor(workers)


def workers_of(executor: Executor | None) -> int:
    """Return how many tasks an executor works on at once, where it tells."""
    return 1 if executor is None else int(getattr(executor, "_max_workers", 2))


def distribute(
    call: Callable[..., T], tasks: Sequence[tuple[Any, ...]], executor: Executor | None
) -> Iterator[tuple[int, T]]:
    """Yield ``(k, call(*tasks[k]))`` as results come, in no order; without executor, one by one.

    A worker that dies may take all tasks under way with it. These are tried once more, one by one,
    so that a task whose worker dies again is the one to blame: the `task` of `WorkersDied`.
    """
    if executor is None:
        yield from ((k, call(*task)) for k, task in enumerate(tasks))
        return
    waiting, lost = iter(enumerate(tasks)), list[int]()
    running: dict[Future[T], int] = {}
    k = 0
    try:
        while True:
            for k, task in islice(waiting, AHEAD * workers_of(executor) - len(running)):
                try:
                    running[executor.submit(call, *task)] = k
                except futures.BrokenExecutor:
                    lost.append(k)
            if not running:
                break
            # What there is comes before what was lost.
            ended = futures.wait(running, return_when=futures.FIRST_COMPLETED).done
            for future in sorted(ended, key=lambda x: x.cancelled() or bool(x.exception())):
                k = running.pop(future)
                try:
                    result = future.result()
                except Exception as error:
                    if not _worker_died(error):
                        raise
                    lost.append(k)
                else:
                    yield k, result
        for k in [*lost, *(k for k, _ in waiting)]:
            yield k, executor.submit(call, *tasks[k]).result()
    except futures.CancelledError:
        # Nobody here cancels what is waited for.
        raise FpidError(
            "executor: expected one that lasts, got tasks cancelled, as where a scheduler is lost"
        ) from None
    except Exception as error:
        if not _worker_died(error):
            raise
        raise WorkersDied(
            "workers: expected processes that live, got some that died twice over the same task: "
            'out of memory, a script that starts its work outside `if __name__ == "__main__":`, '
            "or an executor that does not outlive its workers (fp.tuning.WorkerPool does)",
            k,
        ) from None
    finally:
        for future in running:
            future.cancel()


def _worker_died(error: Exception) -> bool:
    # Dask's, which need not be installed.
    return isinstance(error, futures.BrokenExecutor) or type(error).__name__ == "KilledWorker"


@checked
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


@checked
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
    here = "127.0.0.1"
    with without_ctrl_c():
        # Without a dashboard, too, there is a page of each, on every interface if not told where.
        cluster = distributed.LocalCluster(
            workers, threads_per_worker=1, host=here, dashboard_address=f"{here}:0",
            worker_dashboard_address=f"{here}:0", silence_logs=40,
        )  # fmt: skip
    try:
        yield cluster
    finally:
        # Workers that do not answer end with this process.
        with suppress(TimeoutError):
            cluster.close(timeout=30.0)
