import csv
import dataclasses
import os
import sqlite3
import threading
from contextlib import closing

import pytest
from bounded import ended
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


def test_a_ledger_gives_back_every_bit_and_its_campaign(made):
    path, data = made
    again = load(path)
    assert bits(again) == bits(data)
    assert again.controllers == ("fractional", "integer")
    assert again.units[:2] == ("1", "1")
    assert again.parameters == study().parameters
    assert again.seed == 3
    assert again.title == "a test"
    with Ledger(path) as book:
        assert book.study().digest == study(duration=0.1).digest
        assert book.planned == RUNS
        rebuilt = book.study()
    assert rebuilt.samples(0, 5).tobytes() == data.samples[:5].tobytes()


def test_other_programs_can_read_it(made):
    with closing(sqlite3.connect(made[0])) as file:
        rows = file.execute('SELECT run, rms, "q0.1" FROM results WHERE controller = 1').fetchall()
    data = made[1]
    assert [row[0] for row in rows] == list(range(RUNS))
    assert [row[1] for row in rows] == data.metrics["rms"][:, 1].tolist()
    assert [row[2] for row in rows] == data.samples[:, -1].tolist()


def test_csv_has_every_digit_and_one_order(made, tmp_path):
    path, data = made
    written = export(data, tmp_path / "a.csv").read_bytes()
    assert export(load(path), tmp_path / "b.csv").read_bytes() == written
    with open(tmp_path / "a.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(int(r["run"]), r["controller"]) for r in rows] == [
        (k, name) for k in range(RUNS) for name in data.controllers
    ]
    for name in METRICS:
        assert [float(r[name]) for r in rows] == data.metrics[name].ravel().tolist()
    assert [float(r["payload"]) for r in rows[::2]] == data.samples[
        :, data.parameters.index("payload")
    ].tolist()


def test_parquet_and_pandas_have_the_same_numbers(made, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    data = made[1]
    table = parquet.read_table(export(data, tmp_path / "a.parquet"))
    assert table.column("rms").to_pylist() == data.metrics["rms"].ravel().tolist()
    frame = data.to_dataframe()
    assert list(frame.columns) == table.column_names
    assert frame["payload"].tolist() == table.column("payload").to_pylist()
    with pytest.raises(ArgumentError, match=r"\.csv or \.parquet"):
        export(data, tmp_path / "a.xlsx")


def test_another_campaign_is_refused_with_the_difference(made):
    path = made[0]
    with pytest.raises(FileFormatError, match=r"scenarios\.seed is 3 there and 4 here"):
        run(study(duration=0.1, seed=4), path, 3)
    with pytest.raises(FileFormatError, match=r"experiment\.duration is 0\.1 there and 0\.2 here"):
        run(study(duration=0.2), path, 3)
    other = study(duration=0.1)
    laws = dict(other.controllers)
    laws["integer"] = dataclasses.replace(laws["integer"], kp=(11.0, 12.0))
    with pytest.raises(FileFormatError, match=r"controllers\.integer\.kp\.0 is"):
        run(dataclasses.replace(other, controllers=laws), path, 3)
    backwards = dict(reversed(other.controllers.items()))
    with pytest.raises(FileFormatError, match="another order"):
        run(dataclasses.replace(other, controllers=backwards), path, 3)
    # A title decides no result.
    assert run(dataclasses.replace(other, title="another"), path, 3).runs == RUNS


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


def test_another_layout_and_damage_are_refused(made, tmp_path):
    def copy(name):
        path = tmp_path / name
        with closing(sqlite3.connect(made[0])) as source, closing(sqlite3.connect(path)) as target:
            source.backup(target)
        return path

    newer = copy("newer.sqlite")
    with closing(sqlite3.connect(newer)) as file:
        file.execute("PRAGMA user_version = 7")
    with pytest.raises(FileFormatError, match="ledger of layout 1, got layout 7"):
        load(newer)
    without = copy("without.sqlite")
    with closing(sqlite3.connect(without)) as file:
        file.execute("UPDATE meta SET value = '{' WHERE key = 'study'")
        file.commit()
    with pytest.raises(FileFormatError, match="expected a sound ledger"):
        load(without)
    torn = copy("torn.sqlite")
    os.truncate(torn, os.path.getsize(torn) // 2)
    with pytest.raises(FileFormatError, match="sound ledger"):
        load(torn)


def test_a_locked_ledger_is_told_and_stays_readable(made, tmp_path, monkeypatch):
    connect = sqlite3.connect
    monkeypatch.setattr(ours.sqlite3, "connect", lambda *a, **k: connect(*a, timeout=0.1, **k))
    path = tmp_path / "l.sqlite"
    before = run(study(duration=0.1), path, 6)
    with closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(FileFormatError, match="database is locked"):
            run(study(duration=0.1), path, 12)
        assert bits(load(path)) == bits(before)
        other.execute("ROLLBACK")
    assert run(study(duration=0.1), path, 12).runs == 12


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


def test_it_is_read_while_it_runs(tmp_path):
    path, seen = tmp_path / "l.sqlite", []

    def look(progress):
        data = load(path)
        seen.append(data.runs)
        export(data, tmp_path / "now.csv")

    run(study(duration=0.05), path, 40, chunk=10, progress=look)
    assert seen == [10, 20, 30, 40]


def test_a_ledger_that_somebody_has_altered_is_refused_or_mended(made, tmp_path):
    path = tmp_path / "l.sqlite"
    whole = run(study(duration=0.1), path, 12)

    def alter(command):
        with closing(sqlite3.connect(path)) as file:
            file.execute(command)
            file.commit()

    alter("DELETE FROM results WHERE run = 5 AND controller = 1")
    assert load(path).runs == 5
    assert bits(run(study(duration=0.1), path, 12)) == bits(whole)
    alter("UPDATE results SET rms = 'much' WHERE run = 3")
    with pytest.raises(FileFormatError, match="expected a sound ledger"):
        load(path)


def test_two_drivers_at_once_are_refused(tmp_path):
    path, found = tmp_path / "l.sqlite", []

    def second(progress):
        def attempt():
            try:
                run(study(duration=0.05), path, 4)
            except FileFormatError as error:
                found.append(str(error))

        thread = threading.Thread(target=attempt, daemon=True)
        thread.start()
        assert ended(thread)

    run(study(duration=0.05), path, 4, chunk=4, progress=second)
    assert "another fpid-pin at work" in found[0]


def test_a_study_of_kinds_of_ones_own_says_what_is_missing(tmp_path):
    table = study().to_dict()
    table["experiment"]["reference"] = {"kind": "of_my_own"}
    with pytest.raises(FileFormatError, match=r"experiment\.reference\.kind"):
        Study.from_dict(table)
    with pytest.raises(FileFormatError, match="format 1"):
        Study.from_dict({"format": 2})
    with pytest.raises(ArgumentError, match="at least one"):
        Study(fp.paper_experiment(), {}, study().scenarios)
