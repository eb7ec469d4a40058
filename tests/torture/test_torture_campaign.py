"""Killed at any moment and gone on with, a campaign is as never disturbed."""

import os
import random
import signal
import sqlite3
import time
from contextlib import closing

import pytest
from bounded import wait_until
from test_torture_kills import SHORT, end_of, start

from fpid_pin.campaign import export, load

pytestmark = pytest.mark.torture
FULL = os.environ.get("FPID_TORTURE") == "full"
RUNS, KILLS, DURATION = (600, 20, 2.0) if FULL else (200, 1, 0.5)
CAMPAIGN = """
[campaign]
seed = 2
controllers = ["FPID, published orders", "integer PID"]
[campaign.uncertain]
mass = { kind = "uniform", low = 0.8, high = 1.2 }
payload = { kind = "uniform", low = 0.0, high = 1.0 }
position_noise = { kind = "log_uniform", low = 1e-5, high = 1e-3 }
"""


def campaign(folder, *options):
    return start(
        folder, "campaign", "run", "study.toml", "--out", "l.sqlite", "--runs", str(RUNS),
        "--chunk", "8", *options,
    )  # fmt: skip


def new_folder(tmp_path, name):
    folder = tmp_path / name
    folder.mkdir()
    text = SHORT.replace("duration = 0.1", f"duration = {DURATION}")
    (folder / "study.toml").write_text(text + CAMPAIGN)
    return folder


def table_of(folder):
    return export(load(folder / "l.sqlite"), folder / "table.csv").read_bytes()


@pytest.fixture(scope="module")
def never(tmp_path_factory):
    """Return the table of a campaign that nobody disturbed, and how long it took [s]."""
    folder = new_folder(tmp_path_factory.mktemp("never"), "campaign")
    began = time.monotonic()
    with campaign(folder) as child:
        status, said = end_of(child)
    assert status == 0, said
    return table_of(folder), time.monotonic() - began


def begun(ledger):
    """Return whether a campaign under way has recorded anything."""
    try:
        with closing(sqlite3.connect(f"file:{ledger}?mode=ro", uri=True)) as file:
            return file.execute("SELECT count(*) FROM results").fetchone()[0] > 0
    except sqlite3.OperationalError:  # not there yet, or not laid out
        return False


def rows_of(ledger):
    """Return how many rows a ledger has; none where it was killed before it was laid out."""
    with closing(sqlite3.connect(ledger)) as file:
        assert file.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        if not file.execute("SELECT count(*) FROM sqlite_master").fetchone()[0]:
            return 0
        return file.execute("SELECT count(*) FROM results").fetchone()[0]


def damage_of(ledger):
    """Return what is wrong with what a campaign has left at any moment: a part of a chunk."""
    rows = rows_of(ledger) if ledger.exists() else 0
    return "" if rows % 16 == 0 else f"{rows} rows"


def test_a_campaign_killed_at_any_moment_and_resumed(never, tmp_path, tally):
    table, seconds = never
    chance, kills, round_, midway = random.Random(8), 0, 0, 0
    while kills < KILLS:
        folder = new_folder(tmp_path, str(round_))
        options = ("--workers", "2") if round_ % 2 else ()
        round_ += 1
        status = None
        while status != 0:
            with campaign(folder, *options) as child:
                if kills == 0:
                    assert wait_until(lambda ledger=folder / "l.sqlite": begun(ledger))
                elif kills < KILLS:
                    time.sleep(chance.uniform(0.2, 0.8) * seconds)
                if kills < KILLS:
                    child.kill()
                status, said = end_of(child)
            if status == 0:
                break
            assert status == -signal.SIGKILL, said
            kills += 1
            tally("SIGKILL over a campaign", damage_of(folder / "l.sqlite"))
            midway += (folder / "l.sqlite").exists() and rows_of(folder / "l.sqlite") > 0
        tally("and then resumed", "" if table_of(folder) == table else "another table")
    assert midway > 0
