"""A run is one file that says everything and executes nothing."""

import dataclasses
import json

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import npz
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import FileFormatError, FpidError
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
    assert back.arm == run.arm
    again = fp.simulate(back.experiment, back.controller)
    assert (again.q == run.q).all()
    assert (again.kd == run.kd).all()


def test_nothing_in_it_is_pickled(run, tmp_path):
    with np.load(run.save(tmp_path / "run.npz"), allow_pickle=False) as file:
        assert all(file[name].dtype.kind in "fU" for name in file.files)
        meta = json.loads(str(file["meta"]))
    assert {"fpid_pin", "pin", "numpy", "scipy", "python"} <= meta["versions"].keys()


def test_what_could_not_be_read_back_is_not_written(run, tmp_path):
    for signals, message in (
        ({"x": np.zeros((len(run.t), 2, 2))}, "signals.x: expected a signal with 201 rows"),
        ({"a/b": run.t}, "arrays: expected names that a file can have, got 'signal_a/b'"),
    ):
        with pytest.raises(fp.exceptions.ArgumentError, match=message):
            dataclasses.replace(run, signals=signals).save(tmp_path / "run.npz")
    assert list(tmp_path.iterdir()) == []


def test_a_file_that_is_no_run_is_told(run, tmp_path):
    path = tmp_path / "file.npz"
    npz.write(path, "checkpoint", {}, {"q": run.q})
    with pytest.raises(FileFormatError, match="npz: expected a run file, got a checkpoint"):
        fp.Run.load(path)


def test_a_record_whose_descriptions_mean_nothing_is_one_line(run, tmp_path):
    meta = dict(run.meta) | {"arm": dict(run.meta["arm"]) | {"changes": [[0, 1], "x"]}}
    back = fp.Run.load(dataclasses.replace(run, meta=meta).save(tmp_path / "run.npz"))
    with pytest.raises(FpidError) as caught:
        _ = back.arm
    assert "\n" not in str(caught.value)


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
    other = fp.Run.load(small)
    assert other.save(tmp_path / "again.npz").read_bytes() == plain.read_bytes()
    assert run.save(tmp_path / "twice.npz", compressed=True).read_bytes() == small.read_bytes()


NAMES = """<robot name="nan"><link name="base"/>
<link name="a"><inertial><mass value="1"/><origin xyz="1 0 0"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="inf" type="revolute"><parent link="base"/><child link="a"/><axis xyz="0 1 0"/>
<limit lower="-3" upper="3" effort="100" velocity="10"/></joint></robot>
"""


def test_joints_and_laws_may_be_called_what_numbers_are_called(tmp_path):
    (tmp_path / "inf.urdf").write_text(NAMES)
    arm = fp.Arm.from_urdf(tmp_path / "inf.urdf").with_payload(1.0, frame="inf")
    law = fp.AdaptiveFpid(1.0, 1.0, 1.0, name="-inf")
    run = fp.simulate(fp.Experiment(arm, Hold(0.1), duration=0.01), law)
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    assert (back.name, back.controller.name, back.arm.joint_names) == ("-inf", "-inf", ("inf",))


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
