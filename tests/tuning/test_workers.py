"""Worker processes: what happens when one dies, and that none is left."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from dataclasses import replace

import psutil
import pytest
from bounded import PATIENCE, started, wait_until
from threadpoolctl import threadpool_info

import fpid_pin as fp
from fpid_pin.exceptions import WorkersDied
from fpid_pin.tuning import SearchSettings, Space, WorkerPool, tune

EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))


def sleep_long(begun):
    begun.touch()
    time.sleep(3600)


def blas_threads():
    return {lib["num_threads"] for lib in threadpool_info() if lib["user_api"] == "blas"}


class Deadly(fp.disturbances.Cosine):
    """Kills its process where that is a worker."""

    def sample(self, t):
        if multiprocessing.parent_process() is not None:
            os._exit(9)
        return super().sample(t)


def test_where_workers_die_again_evaluate_says_so_and_a_search_goes_on_in_this_process():
    deadly = replace(EXPERIMENT, plant=fp.Plant(disturbance=Deadly(amplitude=(0.4, 0.6))))
    settings = SearchSettings(population=4, generations=2)
    alone = tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings)
    with WorkerPool(2) as pool:
        with pytest.raises(WorkersDied, match="died twice over the same task: out of memory, "):
            fp.evaluate(deadly, CONTROLLER, executor=pool)
        with pytest.warns(fp.FpidWarning, match="died twice .* going on in this process"):
            result = tune(deadly, CONTROLLER, ORDERS, settings=replace(settings, executor=pool))
    assert result.history.best.tobytes() == alone.history.best.tobytes()


def test_workers_use_one_thread(monkeypatch):
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(name, "2")
    with WorkerPool(1) as fresh:
        assert fresh.submit(blas_threads).result(timeout=PATIENCE) == {1}


def test_after_a_fault_nobody_waits_for_the_tasks(tmp_path):
    workers, begun = [], tmp_path / "begun"

    def interrupted():
        with WorkerPool(1) as fresh:
            # Longer than any test may take: whoever waits for it is stopped.
            fresh.submit(sleep_long, begun)
            assert wait_until(begun.exists)
            workers.extend(psutil.Process(pid) for pid in fresh.processes)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(workers) == 1
    assert not workers[0].is_running()


SCRIPT = """
import sys, time
from fpid_pin.tuning import WorkerPool

if __name__ == "__main__":
    pool = WorkerPool(1)
    tasks = [pool.submit(time.sleep, 0.01) for _ in range(8)]
    [task.result() for task in tasks]
    print(*pool.processes, flush=True)
    time.sleep(600)
"""


def test_workers_do_not_outlive_a_killed_parent(tmp_path):
    script = tmp_path / "parent.py"
    script.write_text(SCRIPT)
    with started([sys.executable, str(script)], stdout=subprocess.PIPE, text=True) as parent:
        workers = [psutil.Process(int(pid)) for pid in parent.stdout.readline().split()]
        assert len(workers) == 1
        parent.send_signal(signal.SIGKILL)
    _, alive = psutil.wait_procs(workers, timeout=PATIENCE)
    assert [p for p in alive if p.status() != psutil.STATUS_ZOMBIE] == []
