"""A run is one file that says everything and executes nothing."""

import json
import os

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import FileFormatError
from fpid_pin.references import Hold


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
        assert all(file[name].dtype.kind in "fU" for name in file.files)
        meta = json.loads(str(file["meta"]))
    assert meta["format"] == 1
    assert {"fpid_pin", "pin", "numpy", "scipy", "python"} <= meta["versions"].keys()


def altered(run, path, **changes):
    run.save(path)
    with np.load(path) as file:
        arrays = {name: file[name] for name in file.files}
    meta = json.loads(str(arrays["meta"]))
    for name, value in changes.items():
        if name in arrays:
            arrays[name] = value
        elif value is None:
            del meta[name]
        else:
            meta[name] = value
    arrays["meta"] = np.array(json.dumps(meta))
    np.savez(path, **arrays)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": 2}, "expected run format 1, got 2"),
        ({"q": np.zeros((3, 2))}, "expected float64"),
        ({"outcome": None}, "'outcome' is missing"),
        ({"q": np.zeros((201, 2), dtype=int)}, r"q: expected float64 of shape|v: expected"),
    ],
)
def test_an_altered_file_is_refused_in_one_line(run, tmp_path, changes, message):
    path = tmp_path / "bad.npz"
    altered(run, path, **changes)
    with pytest.raises(FileFormatError, match=message) as caught:
        fp.Run.load(path)
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
        raise OSError("disk full")

    monkeypatch.setattr(np, "savez", fail)
    with pytest.raises(OSError, match="disk full"):
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
