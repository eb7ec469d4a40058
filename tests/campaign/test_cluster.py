"""A real scheduler and two real workers on loopback."""

import os
import signal
import sqlite3
import subprocess
import sys
from contextlib import closing

import psutil
import pytest
from bounded import PATIENCE, finished, started
from studies import bits, study

import fpid_pin as fp
from fpid_pin.campaign import dask_executor, load, local_cluster, run
from fpid_pin.cli.configuration import demo_config
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ArgumentError, FpidError

pytest.importorskip("distributed")
RUNS = 24


@pytest.fixture(scope="module")
def scheduler():
    with local_cluster(2) as made:
        yield made


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    return run(study(), tmp_path_factory.mktemp("alone") / "ledger.sqlite", RUNS)


def workers_of(made):
    """Return the processes that simulate."""
    return [psutil.Process(nanny.pid) for nanny in made.workers.values()]


def test_a_worker_killed_in_mid_run_leaves_every_run_recorded_once(scheduler, alone, tmp_path):
    killed = []

    def kill(progress):
        if progress.part > 0.2 and not killed:
            killed.append(workers_of(scheduler)[0].pid)
            os.kill(killed[0], signal.SIGKILL)

    ledger = tmp_path / "l.sqlite"
    with dask_executor(scheduler.scheduler_address, patience=PATIENCE) as executor:
        data = run(study(), ledger, RUNS, executor=executor, chunk=2, progress=kill)
    assert killed
    assert bits(data) == bits(alone)
    with closing(sqlite3.connect(ledger)) as file:
        assert file.execute("SELECT count(*) FROM results").fetchone() == (2 * RUNS,)


COMMANDS = """
[campaign.uncertain]
mass = { kind = "uniform", low = 0.8, high = 1.2 }
[tune]
population = 4
generations = 1
seeds = 1
map_points = 0
profile_points = 0
controller = "soft"
[tune.space]
kp = [1, 100, "log", "shared"]
"""
OWN = """
from dataclasses import dataclass
import fpid_pin as fp

@fp.described("soft_pd")
@dataclass(frozen=True, eq=False)
class SoftPd(fp.Controller):
    kp: float = 30.0

    @staticmethod
    def torque(c):
        return c.kp * c.e + 9.0 * c.e_dot
"""


def test_a_law_of_ones_own_is_run_on_workers_and_named_by_its_ledger(
    scheduler, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cluster_law.py").write_text(OWN)
    text = 'import = "cluster_law.py"\n' + demo_config().text.replace(
        "duration = 20.0", "duration = 0.1"
    )
    text += '[[controller]]\nkind = "soft_pd"\nname = "soft"\n' + COMMANDS
    (tmp_path / "study.toml").write_text(text + '[campaign]\ncontrollers = ["soft"]\n')
    words = ["campaign", "run", "study.toml", "--allow-import", "--runs", "4"]
    dask = ["--dask", scheduler.scheduler_address]
    assert main([*words, "--out", "shared.sqlite", *dask]) == 0
    assert main([*words, "--out", "alone.sqlite"]) == 0
    assert bits(load(tmp_path / "shared.sqlite")) == bits(load(tmp_path / "alone.sqlite"))
    # A search takes the same executor.
    for out, more in (("shared", dask), ("alone", [])):
        assert main(["tune", "study.toml", "--allow-import", "--out", out, *more]) == 0
    both = [(tmp_path / out / "history.csv").read_bytes() for out in ("shared", "alone")]
    assert both[0] == both[1]
    # Another process knows of the file from the ledger alone.
    line = [sys.executable, "-m", "fpid_pin.cli.main", "campaign", "resume", "alone.sqlite"]
    refused = finished(line)
    assert refused.returncode == 2
    assert len(refused.stderr.splitlines()) == 1
    assert "expected --allow-import, as the code of" in refused.stderr
    assert "cluster_law.py is run, got none" in refused.stderr
    allowed = finished([*line, "--runs", "6", "--allow-import"])
    assert allowed.returncode == 0, allowed.stderr
    assert load(tmp_path / "alone.sqlite").runs == 6


def test_a_cluster_of_the_command_ends_with_it():
    with started(
        [sys.executable, "-m", "fpid_pin.cli.main", "campaign", "cluster", "--workers", "1"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, start_new_session=True,
    ) as child:  # fmt: skip
        assert child.stdout.readline().startswith("--dask tcp://127.0.0.1:")
        family = psutil.Process(child.pid).children(recursive=True)
        assert family
        # As a terminal does it: to the workers too.
        os.killpg(child.pid, signal.SIGINT)
        assert child.communicate()[1] == "fpid-pin: stopped\n"
    assert child.returncode == 130
    _, alive = psutil.wait_procs(family, timeout=PATIENCE)
    assert not alive


def test_it_listens_on_loopback_only(scheduler):
    for process in (psutil.Process(), *workers_of(scheduler)):
        open_ = [c for c in process.net_connections("inet") if c.status == psutil.CONN_LISTEN]
        assert open_
        assert {c.laddr.ip for c in open_} == {"127.0.0.1"}


def test_workers_of_another_version_are_refused_by_name(scheduler, monkeypatch):
    here = fp.__version__
    monkeypatch.setattr("fpid_pin.simulation.workers.__version__", "99.1")
    words = rf"dask worker tcp://127\.0\.0\.1:\d+: expected fpid_pin 99\.1, as here, got {here}"
    with pytest.raises(FpidError, match=words), dask_executor(scheduler.scheduler_address):
        pass


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "nonsense://x"])
def test_addresses_of_no_scheduler_are_told(address):
    words = rf"dask {address}: expected a Dask scheduler that answers within 0\.5 s, got"
    with pytest.raises(ArgumentError, match=words), dask_executor(address, patience=0.5):
        pass
