"""A pool of worker processes that survives the death of a worker."""

from __future__ import annotations

import io
import multiprocessing
import os
import pickle
import queue
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import (
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
)
from contextlib import contextmanager
from dataclasses import dataclass
from multiprocessing import resource_tracker
from typing import Any, TypeVar

from fpid_pin import checks, own_code
from fpid_pin.exceptions import ArgumentError, TuningError, WorkersDied

T = TypeVar("T")

# One thread a process: Pinocchio's and BLAS's threads collapse where processes share the cores.
_THREAD_SETTINGS = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "NUMEXPR_NUM_THREADS",
)


@contextmanager
def _deaf() -> Iterator[None]:
    """Let processes that are started here not hear Ctrl-C, from their first instruction on.

    A terminal sends it to them too, also while they import what they will need.
    """
    # It unblocks the signal where it starts, so that must have happened.
    resource_tracker.ensure_running()
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Let processes that are started here read from the environment to use one thread each."""
    before = {name: os.environ.get(name) for name in _THREAD_SETTINGS}
    os.environ.update(dict.fromkeys(_THREAD_SETTINGS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def _prepare_worker(own: list[str]) -> None:
    """Leave Ctrl-C to the parent, do not outlive it, and run the user's files that it has run."""
    own_code.load_again(own)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()
    if parent is None:
        return

    def watch() -> None:
        # A parent killed by SIGKILL cannot say goodbye, and the pool's pipes stay open.
        parent.join()
        os._exit(1)

    threading.Thread(target=watch, daemon=True, name="parent watch").start()


class _Finder(pickle.Pickler):
    """Finds out what of a session a task refers to."""

    found = ""

    def reducer_override(self, thing: Any) -> Any:
        """Note a class or function of the session, and go on."""
        if getattr(thing, "__module__", "") == "__main__" and hasattr(thing, "__qualname__"):
            self.found = self.found or thing.__qualname__
        return NotImplemented


def _refuse_homeless(task: Any) -> None:
    """Refuse what a worker could not import: it would die over it, and not say why."""
    script = getattr(sys.modules["__main__"], "__file__", None)
    if script is not None:
        if not os.path.isfile(script):
            # Each would die over it, whatever it was to do.
            raise TuningError(
                f"workers: expected a script in a file, got {script}: worker processes begin by "
                "importing it"
            )
        return
    finder = _Finder(io.BytesIO())
    finder.dump(task)
    if finder.found:
        raise TuningError(
            f"workers: expected classes and functions of a module, got {finder.found}, which this "
            "session defines: worker processes cannot import it; write it into a file and import "
            "that, or use no workers"
        )


@dataclass(eq=False)
class _Task:
    call: Callable[..., Any]
    positional: tuple[Any, ...]
    named: dict[str, Any]
    future: Future[Any]
    lives: int


class WorkerPool(Executor):
    """Worker processes for ``executor=``, wherever there is one.

    A task whose worker dies is sent to a fresh pool, so that no result is lost. Workers are
    spawned, not forked, use one thread each, and end when their parent does, however it ends.

    Parameters
    ----------
    workers
        Number of processes.
    retries
        How often one task may lose its worker before its future fails.

    Notes
    -----
    Spawned workers import the main script: it must start its work under
    ``if __name__ == "__main__":``.
    """

    def __init__(self, workers: int, *, retries: int = 3) -> None:
        self._max_workers = checks.integer("workers", workers, low=1)
        self._retries = checks.integer("retries", retries, low=0)
        self._lock = threading.Lock()
        self._pool: ProcessPoolExecutor | None = None
        self._closed = False
        self._lost: queue.SimpleQueue[_Task | None] = queue.SimpleQueue()
        self._keeper = threading.Thread(target=self._resend, daemon=True, name="worker pool")
        self._keeper.start()

    @property
    def processes(self) -> list[int]:
        """Process ids of the workers that run now."""
        return sorted(process.pid for process in self._workers())

    def _workers(self) -> list[Any]:
        # Not public before Python 3.14, which can only end them, not name them.
        return list((getattr(self._pool, "_processes", None) or {}).values())

    def submit(self, fn: Callable[..., T], /, *args: Any, **kwargs: Any) -> Future[T]:
        """See `concurrent.futures.Executor.submit`."""
        if self._closed:
            raise RuntimeError("the worker pool has been shut down")
        _refuse_homeless((fn, args, kwargs))
        task = _Task(fn, args, kwargs, Future(), self._retries)
        task.future.set_running_or_notify_cancel()
        self._send(task)
        return task.future

    def _send(self, task: _Task) -> None:
        with self._lock, _one_thread(), _deaf():
            for _ in range(2):
                if self._pool is None:
                    self._pool = ProcessPoolExecutor(
                        self._max_workers,
                        mp_context=multiprocessing.get_context("spawn"),
                        initializer=_prepare_worker,
                        initargs=(own_code.loaded(),),
                    )
                try:
                    inner = self._pool.submit(task.call, *task.positional, **task.named)
                    break
                except BrokenExecutor:
                    # Broken since the last task; its own tasks come back through the queue.
                    self._pool = None
            else:
                task.future.set_exception(TuningError("worker processes cannot be started"))
                return
            pool = self._pool
        inner.add_done_callback(lambda done: self._settle(task, pool, done))

    def _settle(self, task: _Task, pool: ProcessPoolExecutor, inner: Future[Any]) -> None:
        # Runs in the pool's own thread, which may hold the pool's lock: nothing here may wait for
        # ours, so whatever was lost goes to the keeper.
        if inner.cancelled():
            task.future.set_exception(CancelledError())
            return
        error = inner.exception()
        if error is None:
            task.future.set_result(inner.result())
        elif not isinstance(error, BrokenExecutor) or self._closed:
            task.future.set_exception(error)
        elif task.lives == 0:
            task.future.set_exception(
                WorkersDied(
                    f"worker processes died over the same task ({self._retries + 1} tried): out of "
                    "memory, or a script that starts its work outside "
                    '`if __name__ == "__main__":`'
                )
            )
        else:
            task.lives -= 1
            if self._pool is pool:
                self._pool = None
            self._lost.put(task)

    def _resend(self) -> None:
        while (task := self._lost.get()) is not None:
            try:
                self._send(task)
            except Exception as error:
                task.future.set_exception(error)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """See `concurrent.futures.Executor.shutdown`."""
        with self._lock:
            self._closed = True
            pool = self._pool
        self._lost.put(None)
        if pool is not None:
            pool.shutdown(wait=wait, cancel_futures=cancel_futures)

    def __exit__(self, *fault: object) -> None:
        if fault[0] is not None:
            # Nobody waits for results after a fault or Ctrl-C, and a task may last for minutes.
            self._closed = True
            for process in self._workers():
                process.terminate()
        self.shutdown(wait=True, cancel_futures=fault[0] is not None)


def check_workers(executor: Executor | None, workers: int | None) -> None:
    """Check that there are worker processes of one kind at most."""
    if workers is not None:
        checks.integer("workers", workers, low=1)
        if executor is not None:
            raise ArgumentError("workers", "workers or executor, not both", workers)
    if executor is not None and not callable(getattr(executor, "submit", None)):
        raise ArgumentError("executor", "an Executor", type(executor).__name__)
