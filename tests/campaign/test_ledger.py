import csv
import dataclasses
import os
import sqlite3
import sys
from contextlib import closing

import pytest
from bounded import finished
from studies import bits, study

import fpid_pin as fp
from fpid_pin.campaign import export, load, run
from fpid_pin.campaign import ledger as ours
from fpid_pin.campaign.data import METRICS
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.campaign.study import Study
from fpid_pin.exceptions import ArgumentError, FileFormatError

RUNS = 20


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a ledger and what it holds."""
    path = tmp_path_factory.mktemp("made") / "ledger.sqlite"
    return path, run(study(duration=0.1), path, RUNS, chunk=4)


def test_a_ledger_gives_back_every_bit_and_its_campaign_and_other_programs_read_it(made):
    path, data = made
    again = load(path)
    assert bits(again) == bits(data)
    assert (again.controllers, again.seed) == (("fractional", "integer"), 3)
    assert (again.title, again.units[:2]) == ("a test", ("1", "1"))
    assert again.parameters == study().parameters
    with Ledger(path) as book:
        rebuilt = book.study()
        assert book.planned == RUNS
    assert rebuilt.text == study(duration=0.1).text
    assert rebuilt.samples(0, 5).tobytes() == data.samples[:5].tobytes()
    with closing(sqlite3.connect(path)) as file:
        rows = file.execute('SELECT run, rms, "q0.1" FROM results WHERE controller = 1').fetchall()
    expected = zip(range(RUNS), data.metrics["rms"][:, 1], data.samples[:, -1], strict=True)
    assert rows == list(expected)


def test_tables_have_every_digit_and_one_order(made, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    path, data = made
    written = export(data, tmp_path / "a.csv").read_bytes()
    assert export(load(path), tmp_path / "b.csv").read_bytes() == written
    frame = data.to_dataframe()
    rows = list(csv.DictReader(written.decode().splitlines()))
    assert list(rows[0]) == list(frame.columns)
    order = [(str(k), name) for k in range(RUNS) for name in data.controllers]
    assert [(row["run"], row["controller"]) for row in rows] == order
    table = parquet.read_table(export(data, tmp_path / "a.parquet"))
    for name in (*METRICS, "payload"):
        numbers = table.column(name).to_pylist()
        assert numbers == frame[name].tolist() == [float(row[name]) for row in rows]
    assert frame["rms"].tolist() == data.metrics["rms"].ravel().tolist()
    with pytest.raises(ArgumentError, match=r"\.csv or \.parquet"):
        export(data, tmp_path / "a.xlsx")


EARLY = """
import os, sqlite3, sys
sys.path.insert(0, sys.argv[1])
from studies import study
from fpid_pin.campaign import run
connect = sqlite3.connect

class Killed(sqlite3.Connection):
    def execute(self, sql, *arguments):
        if "user_version" in sql:
            os._exit(9)
        return super().execute(sql, *arguments)

sqlite3.connect = lambda *a, **k: connect(*a, factory=Killed, **k)
run(study(duration=0.05), "l.sqlite", 4)
"""


def test_killed_before_its_tables_stand_a_campaign_begins_anew(tmp_path):
    path, here = tmp_path / "l.sqlite", os.path.dirname(__file__)
    assert finished([sys.executable, "-c", EARLY, here], cwd=tmp_path).returncode == 9
    assert not path.exists()
    path.touch()  # as an earlier version left it
    with Ledger(path, study(duration=0.05), 4):
        pass
    # Killed then, before its first run, it is resumed from itself alone.
    with Ledger(path) as book:
        assert (book.planned, book.recorded()) == (4, set())
        made = book.study()
    assert bits(run(made, path, 4)) == bits(run(made, tmp_path / "other.sqlite", 4))


def test_another_campaign_is_refused_with_the_difference(made):
    path, same = made[0], study(duration=0.1)
    laws = dict(same.controllers)
    laws["integer"] = dataclasses.replace(laws["integer"], kp=(11.0, 12.0))
    backwards = dict(reversed(same.controllers.items()))
    for other, words in (
        (study(duration=0.1, seed=4), r"scenarios\.seed is 3 there and 4 here"),
        (study(duration=0.2), r"experiment\.duration is 0\.1 there and 0\.2 here"),
        (dataclasses.replace(same, controllers=laws), r"controllers\.integer\.kp\.0 is"),
        (dataclasses.replace(same, controllers=backwards), "another order"),
    ):
        with pytest.raises(FileFormatError, match=words):
            run(other, path, 3)
    # A title decides no result.
    assert run(dataclasses.replace(same, title="another"), path, 3).runs == RUNS


def test_files_that_are_no_ledgers_are_refused_untouched(tmp_path):
    text = tmp_path / "notes.txt"
    text.write_text("not a database, and longer than the sixteen bytes of its head" * 20)
    foreign = tmp_path / "foreign.sqlite"
    with closing(sqlite3.connect(foreign)) as file:
        file.execute("CREATE TABLE mine (x)")
        file.commit()
    for path, words in (
        (text, "file is not a database"),
        (foreign, "got another SQLite file"),
        (tmp_path, "got a folder"),
    ):
        before = None if path.is_dir() else path.read_bytes()
        for attempt in (lambda p: run(study(), p, 3), load):
            with pytest.raises(FileFormatError, match=words):
                attempt(path)
        assert path.is_dir() or path.read_bytes() == before
    with pytest.raises(FileFormatError, match="got no file"):
        load(tmp_path / "none.sqlite")
    assert not (tmp_path / "none.sqlite").exists()


def test_another_layout_and_damage_are_refused_and_lost_rows_are_made_again(made, tmp_path):
    path = tmp_path / "l.sqlite"

    def altered(command):
        with closing(sqlite3.connect(made[0])) as source, closing(sqlite3.connect(path)) as target:
            source.backup(target)
            target.execute(command)
            target.commit()

    for command, words in (
        ("PRAGMA user_version = 7", "ledger of layout 3, got layout 7"),
        ("UPDATE meta SET value = '{' WHERE key = 'study'", "expected a sound ledger"),
        ("UPDATE results SET rms = 'much' WHERE run = 3", "expected a sound ledger"),
    ):
        altered(command)
        with pytest.raises(FileFormatError, match=words):
            load(path)
    altered("DELETE FROM results WHERE run = 5 AND controller = 1")
    assert load(path).runs == 5
    assert bits(run(study(duration=0.1), path, RUNS)) == bits(made[1])
    os.truncate(path, os.path.getsize(path) // 2)
    with pytest.raises(FileFormatError, match="sound ledger"):
        load(path)


def test_it_is_read_while_one_driver_runs_it_and_a_lock_is_told(tmp_path, monkeypatch):
    path, seen = tmp_path / "l.sqlite", []
    connect = sqlite3.connect
    monkeypatch.setattr(ours.sqlite3, "connect", lambda *a, **k: connect(*a, timeout=0.1, **k))

    def look(progress):
        seen.append(load(path).runs)
        with pytest.raises(FileFormatError, match="another fpid-pin at work"):
            run(study(duration=0.05), path, 30)

    before = run(study(duration=0.05), path, 30, chunk=10, progress=look)
    assert seen == [10, 20, 30]
    with closing(connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(FileFormatError, match="database is locked"):
            run(study(duration=0.05), path, 40)
        assert bits(load(path)) == bits(before)


def test_a_full_disk_is_told_and_what_was_recorded_stays(made, tmp_path, monkeypatch):
    path = tmp_path / "l.sqlite"
    connect = sqlite3.connect

    class Full(sqlite3.Connection):
        def executemany(self, sql, rows):
            if "INTO results" in sql:
                pages = self.execute("PRAGMA page_count").fetchone()[0]
                self.execute(f"PRAGMA max_page_count = {max(pages, 6)}")
            return super().executemany(sql, rows)

    monkeypatch.setattr(ours.sqlite3, "connect", lambda *a, **k: connect(*a, factory=Full, **k))
    with pytest.raises(FileFormatError, match=r"database or disk is full"):
        run(study(duration=0.05), path, 60, chunk=10)
    monkeypatch.undo()
    kept = load(path)
    assert 0 < kept.runs < 60
    assert kept.runs % 10 == 0
    whole = run(study(duration=0.05), path, 60)
    assert whole.samples[: kept.runs].tobytes() == kept.samples.tobytes()
    assert bits(whole) == bits(run(study(duration=0.05), tmp_path / "sound.sqlite", 60))


def test_a_study_of_kinds_of_ones_own_says_what_is_missing(tmp_path):
    run(study(duration=0.05), tmp_path / "own.sqlite", 1)
    with closing(sqlite3.connect(tmp_path / "own.sqlite")) as file:
        file.execute("UPDATE meta SET value = replace(value, 'sinusoid', 'my_own')")
        file.commit()
    with Ledger(tmp_path / "own.sqlite") as ledger:
        line = r"own\.sqlite: experiment\.reference\.kind: expected .* got 'my_own'"
        with pytest.raises(FileFormatError, match=line):
            ledger.study()
    with pytest.raises(ArgumentError, match="at least one"):
        Study(fp.paper_experiment(), {}, study().scenarios)
