import csv
import dataclasses
import errno

import numpy as np
import pytest
from studies import bits, study

import fpid_pin as fp
from fpid_pin import npz
from fpid_pin.campaign import export, load, run
from fpid_pin.campaign import ledger as ours
from fpid_pin.campaign.data import METRICS
from fpid_pin.campaign.ledger import Ledger
from fpid_pin.campaign.study import Study
from fpid_pin.exceptions import ArgumentError, FileFormatError
from fpid_pin.files import unwritable

RUNS = 20


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a ledger and what it holds."""
    path = tmp_path_factory.mktemp("made") / "ledger.npz"
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
    with np.load(path) as file:
        assert np.array_equal(file["samples"], data.samples)
        assert np.array_equal(file["ends"][:, 1, 2], data.metrics["rms"][:, 1])


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


def test_killed_before_its_first_run_a_campaign_is_resumed_from_itself_alone(tmp_path):
    path = tmp_path / "l.npz"
    with Ledger(path, study(duration=0.05), 4):
        pass
    with Ledger(path) as book:
        assert (book.planned, book.missing()) == (4, [0, 1, 2, 3])
        made = book.study()
    assert load(path).runs == 0
    assert bits(run(made, path, 4)) == bits(run(made, tmp_path / "other.npz", 4))


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
    text, other = tmp_path / "notes.txt", tmp_path / "run.npz"
    text.write_text("not a ledger")
    fp.simulate(fp.paper_experiment(duration=0.01), fp.paper_controller()).save(other)
    for path, words in (
        (text, "expected a campaign's ledger, got another file or a damaged one"),
        (other, "expected a campaign's ledger, got a run"),
        (tmp_path, "expected a campaign's ledger, got no file"),
    ):
        before = None if path.is_dir() else path.read_bytes()
        for attempt in (lambda p: run(study(), p, 3), load):
            with pytest.raises(FileFormatError, match=words):
                attempt(path)
        assert path.is_dir() or path.read_bytes() == before
    with pytest.raises(FileFormatError, match="no such file"):
        load(tmp_path / "none.npz")
    assert not (tmp_path / "none.npz").exists()


def test_damage_is_refused_and_lost_rows_are_made_again(made, tmp_path):
    path = tmp_path / "l.npz"
    arrays, table = npz.read(made[0], ours.KIND)
    arrays["ends"][5, 1] = np.nan
    npz.write(path, ours.KIND, table, arrays)
    assert load(path).runs == 5
    assert bits(run(study(duration=0.1), path, RUNS)) == bits(made[1])
    whole = bytearray(path.read_bytes())
    whole[len(whole) // 2] ^= 1
    for damaged in (whole, whole[: len(whole) // 2]):
        path.write_bytes(damaged)
        with pytest.raises(FileFormatError, match="a damaged one"):
            load(path)


def test_it_is_read_while_one_driver_runs_it(tmp_path, monkeypatch):
    path, seen = tmp_path / "l.npz", []
    monkeypatch.setattr(ours, "PAUSE", 0.0)

    def look(progress):
        seen.append(load(path).runs)
        with pytest.raises(FileFormatError, match="another fpid-pin at work"):
            run(study(duration=0.05), path, 30)

    run(study(duration=0.05), path, 30, chunk=10, progress=look)
    assert seen == [10, 20, 30]
    # Where it takes long to write, it is not written for each chunk, and whole at the end.
    monkeypatch.setattr(ours, "PAUSE", 1e6)
    whole = run(
        study(duration=0.05), path, 60, chunk=10, progress=lambda p: seen.append(load(path))
    )
    assert [data.runs for data in seen[3:]] == [30, 30, 30]
    assert bits(load(path)) == bits(whole)


def test_a_full_disk_is_told_and_what_was_recorded_stays(tmp_path, monkeypatch):
    path, write = tmp_path / "l.npz", npz.write
    monkeypatch.setattr(ours, "PAUSE", 0.0)

    def full(path, kind, table, arrays):
        if np.isfinite(arrays["ends"][20:]).any():
            raise unwritable(path, OSError(errno.ENOSPC, "No space left on device"))
        write(path, kind, table, arrays)

    monkeypatch.setattr(npz, "write", full)
    with pytest.raises(FileFormatError, match=r"l\.npz: cannot be written \(No space left"):
        run(study(duration=0.05), path, 60, chunk=10)
    monkeypatch.undo()
    kept = load(path)
    assert kept.runs == 20
    whole = run(study(duration=0.05), path, 60)
    assert whole.samples[:20].tobytes() == kept.samples.tobytes()
    assert bits(whole) == bits(run(study(duration=0.05), tmp_path / "sound.npz", 60))


def test_a_study_of_kinds_of_ones_own_says_what_is_missing(tmp_path):
    run(study(duration=0.05), tmp_path / "own.npz", 1)
    arrays, table = npz.read(tmp_path / "own.npz", ours.KIND)
    table["study"]["experiment"]["reference"]["kind"] = "my_own"
    npz.write(tmp_path / "own.npz", ours.KIND, table, arrays)
    with Ledger(tmp_path / "own.npz") as ledger:
        line = r"own\.npz: experiment\.reference\.kind: expected .* got 'my_own'"
        with pytest.raises(FileFormatError, match=line):
            ledger.study()
    with pytest.raises(ArgumentError, match="at least one"):
        Study(fp.paper_experiment(), {}, study().scenarios)
