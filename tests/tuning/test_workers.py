import os
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future
from dataclasses import replace

import psutil
import pytest
from bounded import PATIENCE, started, wait_until

import fpid_pin as fp
from fpid_pin.exceptions import TuningError
from fpid_pin.tuning import SearchSettings, Space, WorkerPool, tune

EXPERIMENT = fp.paper_experiment(duration=0.3, step=5e-3)
CONTROLLER = fp.paper_controller(supervised=False)
ORDERS = Space(integral_order=(0, 1), derivative_order=(0, 1))


def slow_square(x):
    time.sleep(0.05)
    return x * x


def sleep_long(begun):
    begun.touch()
    time.sleep(3600)


def die(_):
    os._exit(3)


def refuse(_):
    raise ValueError("no")


def setting(name):
    return os.environ.get(name)


@pytest.fixture(scope="module")
def pool():
    with WorkerPool(2) as made:
        yield made


def test_killed_workers_lose_no_result(pool):
    futures = [pool.submit(slow_square, x) for x in range(60)]
    futures[5].result(timeout=PATIENCE)
    os.kill(pool.processes[0], signal.SIGKILL)
    assert [future.result(timeout=PATIENCE) for future in futures] == [x * x for x in range(60)]


def test_a_search_whose_worker_is_killed_gives_the_same_bits(pool):
    settings = SearchSettings(population=6, generations=4, seeds=1)
    killed = []

    def kill(progress):
        if progress.generation == 2 and not killed:
            killed.append(progress.generation)
            os.kill(pool.processes[-1], signal.SIGKILL)

    shared = tune(
        EXPERIMENT, CONTROLLER, ORDERS, settings=replace(settings, executor=pool), progress=kill
    )
    alone = tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings)
    assert killed == [2]
    assert shared.history.best.tobytes() == alone.history.best.tobytes()
    assert shared.history.best_parameters.tobytes() == alone.history.best_parameters.tobytes()


def test_errors_of_a_task_are_its_own(pool):
    with pytest.raises(ValueError, match="no"):
        pool.submit(refuse, 0).result(timeout=PATIENCE)


def test_workers_use_one_thread_and_a_task_that_always_dies_ends_with_a_message(monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    with WorkerPool(1, retries=0) as fresh:
        assert fresh.submit(setting, "OMP_NUM_THREADS").result(timeout=PATIENCE) == "1"
        assert fresh.submit(setting, "OPENBLAS_NUM_THREADS").result(timeout=PATIENCE) == "1"
        assert os.environ["OMP_NUM_THREADS"] == "7"
        assert "OPENBLAS_NUM_THREADS" not in os.environ
        with pytest.raises(TuningError, match=r"died over the same task \(1 tried\)"):
            fresh.submit(die, 0).result(timeout=PATIENCE)


def test_after_a_fault_nobody_waits_for_the_tasks(tmp_path):
    workers, begun = [], tmp_path / "begun"

    def interrupted():
        with WorkerPool(1) as fresh:
            fresh.submit(slow_square, 2).result(timeout=PATIENCE)
            workers.extend(psutil.Process(pid) for pid in fresh.processes)
            # Longer than any test may take: whoever waits for it is stopped.
            fresh.submit(sleep_long, begun)
            assert wait_until(begun.exists)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert len(workers) == 1
    assert not workers[0].is_running()


def test_a_closed_pool_takes_nothing():
    pool = WorkerPool(1)
    pool.shutdown()
    with pytest.raises(RuntimeError, match="shut down"):
        pool.submit(slow_square, 1)


def test_an_executor_of_the_users_that_breaks_is_replaced_by_this_process():
    class Broken(Executor):
        def submit(self, fn, /, *args, **kwargs):
            future = Future()
            future.set_exception(BrokenExecutor("a worker is gone"))
            return future

    settings = SearchSettings(population=4, generations=2)
    with pytest.warns(fp.FpidWarning, match="the executor broke"):
        result = tune(EXPERIMENT, CONTROLLER, ORDERS, settings=replace(settings, executor=Broken()))
    alone = tune(EXPERIMENT, CONTROLLER, ORDERS, settings=settings)
    assert result.history.best.tobytes() == alone.history.best.tobytes()


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
