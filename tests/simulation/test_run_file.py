"""A run is one file that says everything and executes nothing."""

import dataclasses
import errno
import json
import os

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import sealed
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import FileFormatError, FpidError
from fpid_pin.references import Hold
from fpid_pin.simulation import run_file
from fpid_pin.simulation.run_table import from_json, to_json


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.paper_experiment(duration=0.2), fp.paper_controller())


def test_it_comes_back_bit_for_bit(run, tmp_path):
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    for name in ("t", "q", "v", "q_ref", "v_ref", "torque", "error", *run.signals):
        assert (getattr(back, name) == getattr(run, name)).all(), name
    assert back.outcome == run.outcome
    assert (back.metrics.ise == run.metrics.ise).all()
    assert back.arm.joint_names == run.arm.joint_names


def test_it_can_be_simulated_again_from_its_record(run, tmp_path):
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    again = fp.simulate(back.experiment, back.controller)
    assert (again.q == run.q).all()
    assert (again.kd == run.kd).all()


def test_nothing_in_it_is_pickled(run, tmp_path):
    with np.load(run.save(tmp_path / "run.npz"), allow_pickle=False) as file:
        assert all(file[name].dtype.kind in "fUS" for name in file.files)
        meta = json.loads(str(file["meta"]))
    assert meta["format"] == 2
    assert {"fpid_pin", "pin", "numpy", "scipy", "python"} <= meta["versions"].keys()


def signed_again(path, change):
    """Alter what a run file holds and seal it as if it had been written so."""
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files if name != "members"}
    meta = from_json(str(arrays.pop("meta")))
    change(meta, arrays)
    with open(path, "wb") as file:
        sealed.write(file, "run file", 2, to_json(meta), arrays)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda m, a: m.update(format=4), "meta.format: expected 2 or 3, got 4"),
        (lambda m, a: m.pop("outcome"), "meta.outcome: expected a table"),
        (lambda m, a: m["outcome"].pop("cause"), "meta.outcome: expected completed, time"),
        (lambda m, a: m["outcome"].update(time="soon"), "meta.outcome.time: expected numbers"),
        (lambda m, a: m.update(step=1e6), r"meta.step: expected a number in \[1e-09, 10\]"),
        (lambda m, a: m.update(step=True), "meta.step: expected numbers"),
        (lambda m, a: m.update(rows=40), r"t: expected float64 of shape \(40,\)"),
        (lambda m, a: m.update(rows=10**30), "meta.rows: expected a whole number in"),
        (lambda m, a: m.update(planned_rows=1), "meta.planned_rows: expected a whole number in"),
        (lambda m, a: m.update(joints=3, effort_limit=[1.0] * 3),
         r"q: expected float64 of shape \(201, 3\)"),
        (lambda m, a: m.update(effort_limit=[1.0]), r"meta.effort_limit: expected shape \(2,\)"),
        (lambda m, a: m.update(effort_limit="x"), "meta.effort_limit: expected a list, got str"),
        (lambda m, a: m.update(effort_limit=[-1, 1]), "effort_limit.0: expected a number >= 0"),
        (lambda m, a: m.update(name=5), "meta.name: expected a text"),
        (lambda m, a: m.pop("arm"), "meta.arm: expected a table"),
        (lambda m, a: a.update(q=np.zeros((3, 2))), "q: expected float64 of shape"),
        (lambda m, a: a.update(q=np.zeros((201, 2), int)), "q: expected float64, got <i8"),
        (lambda m, a: a.pop("torque"), "torque: expected float64 of shape"),
        (lambda m, a: a.update(signal_x=np.zeros(3)), "signal_x: expected a signal with 201"),
        (lambda m, a: a.update(more=np.zeros(201)), "more: expected a signal"),
    ],
)  # fmt: skip
def test_an_altered_run_is_refused_in_one_line_also_where_its_seal_is_right(
    run, tmp_path, change, message
):
    path = run.save(tmp_path / "bad.npz")
    signed_again(path, change)
    with pytest.raises(FileFormatError, match=message) as caught:
        fp.Run.load(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


def test_what_could_not_be_read_back_is_not_written(run, tmp_path):
    signals = {"x": np.zeros((len(run.t), 2, 2))}
    with pytest.raises(fp.exceptions.ArgumentError, match="signal_x: expected a signal with"):
        dataclasses.replace(run, signals=signals).save(tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_format_1_is_told_from_a_damaged_one(run, tmp_path):
    np.savez(tmp_path / "old.npz", meta=np.array("{}"), q=run.q)
    with pytest.raises(FileFormatError, match="without a list of its members: one of format 1"):
        fp.Run.load(tmp_path / "old.npz")


def test_a_record_whose_descriptions_mean_nothing_is_one_line(run, tmp_path):
    path = run.save(tmp_path / "run.npz")
    signed_again(path, lambda m, a: m["arm"].update(changes=[[0, 1], "x"]))
    back = fp.Run.load(path)
    with pytest.raises(FpidError) as caught:
        _ = back.arm
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [b"", b"not a zip file", b"PK\x03\x04 cut"])
def test_what_is_not_a_run_is_refused(tmp_path, content):
    path = tmp_path / "junk.npz"
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="junk.npz"):
        fp.Run.load(path)


def test_a_file_cut_short_is_refused(run, tmp_path):
    path = run.save(tmp_path / "run.npz")
    whole = path.read_bytes()
    for part in (0.3, 0.9, 0.999):
        path.write_bytes(whole[: int(part * len(whole))])
        with pytest.raises(FileFormatError):
            fp.Run.load(path)


def test_a_pickle_inside_is_never_opened(tmp_path):
    path = tmp_path / "evil.npz"

    class Evil:
        def __reduce__(self):
            return os.mkdir, (str(tmp_path / "owned"),)

    np.savez(path, meta=np.array([Evil()], dtype=object))
    with pytest.raises(FileFormatError):
        fp.Run.load(path)
    assert not (tmp_path / "owned").exists()


def test_a_missing_file_and_a_folder_that_cannot_be_written(run, tmp_path):
    with pytest.raises(FileFormatError, match="no such file"):
        fp.Run.load(tmp_path / "none.npz")
    (tmp_path / "file").write_text("x")
    with pytest.raises(FileFormatError, match="cannot be written"):
        run.save(tmp_path / "file" / "run.npz")


def test_a_save_that_fails_leaves_the_old_file(run, tmp_path, monkeypatch):
    path = run.save(tmp_path / "run.npz")
    before = path.read_bytes()

    def fail(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(sealed, "write", fail)
    with pytest.raises(FileFormatError, match=r"cannot be written \(No space left on device\)"):
        run.save(path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["run.npz"]


def test_limits_of_infinity_survive_the_file(tmp_path):
    arm = fp.Arm.two_link()
    plant = fp.Plant(effort_limit=np.inf, disturbance=Pulse(1.0))
    experiment = fp.Experiment(arm, Hold(0.1), plant=plant, duration=0.01)
    run = fp.simulate(experiment, fp.ComputedTorque())
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    assert back.experiment.plant.disturbance.end == np.inf
    with pytest.raises(AttributeError, match="has no 'kp'"):
        _ = back.kp


def test_a_compressed_file_is_smaller_and_gives_every_bit(run, tmp_path):
    plain = run.save(tmp_path / "plain.npz")
    small = run.save(tmp_path / "small.npz", compressed=True)
    assert small.stat().st_size < 0.5 * plain.stat().st_size
    one, other = fp.Run.load(plain), fp.Run.load(small)
    for name in ("t", "q", "v", "q_ref", "v_ref", "torque", *run.signals):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes(), name
    assert one.meta == other.meta
    assert other.save(tmp_path / "again.npz").read_bytes() == plain.read_bytes()
    assert run.save(tmp_path / "twice.npz", compressed=True).read_bytes() == small.read_bytes()
    with np.load(small, allow_pickle=False) as file:
        assert json.loads(str(file["meta"]))["format"] == 3
        assert all(file[name].dtype.kind in "uUS" for name in file.files)


def test_a_run_that_packs_too_well_is_written_as_it_is(run, tmp_path, monkeypatch):
    """A long time at rest packs a thousandfold, as a bomb does."""
    still = dataclasses.replace(
        run, signals={f"zero {k}": np.zeros(len(run.t)) for k in range(5000)}
    )
    monkeypatch.setattr(run_file, "MOST_BYTES", 1000)
    path = still.save(tmp_path / "run.npz", compressed=True)
    assert fp.Run.load(path).meta["format"] == 2
    assert path.stat().st_size > 8 * 5000 * len(run.t)
    run.save(path, compressed=True)
    monkeypatch.setattr(run_file, "MOST_RATIO", 1)
    with pytest.raises(FileFormatError, match="rows: expected as many as a file of its size may"):
        fp.Run.load(path)


def test_a_thinned_run_has_one_row_in_so_many_and_says_so(run, tmp_path):
    thin = fp.Run.load(run.save(tmp_path / "run.npz", every=5, compressed=True))
    assert (thin.q == run.q[::5]).all()
    assert (thin.kp == run.kp[::5]).all()
    assert thin.step == pytest.approx(5e-3)
    assert thin.meta["every"] == 5
    assert len(thin.t) == thin.planned_rows == 41
    assert thin.thinned(2).meta["every"] == 10
    assert len(run.thinned(7).t) == run.thinned(7).planned_rows == 29
    # The same integral by a coarser sum.
    assert thin.metrics.ise == pytest.approx(run.metrics.ise, rel=0.2)
    with pytest.raises(fp.exceptions.ArgumentError, match="every: expected a whole number >= 1"):
        run.save(tmp_path / "no.npz", every=0)
    with pytest.raises(fp.exceptions.ArgumentError, match="every: expected rows at most 10 s"):
        run.thinned(20_000)
