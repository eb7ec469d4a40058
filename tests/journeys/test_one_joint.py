"""An arm of one joint, in every room: Pinocchio returns no matrix where there is one column."""

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin import campaign
from fpid_pin.cli.main import main
from fpid_pin.tuning import SearchSettings, Space

LENGTH, MASS, G = 0.5, 1.2, 9.8
ARM = fp.Arm.planar((LENGTH,), (MASS,)).with_limits(effort=20, velocity=8, lower=-2, upper=2)
MJCF = """<mujoco><worldbody><body name="b"><joint name="j" axis="0 1 0" range="-90 90"/>
<inertial pos=".1 0 0" mass="1" diaginertia=".01 .02 .02"/></body></worldbody>
<actuator><motor joint="j" ctrlrange="-20 20"/></actuator></mujoco>"""
LAWS = {
    "fpid": fp.suggest_gains(ARM, 8.0), "pid": fp.Pid(60, 40, 8), "pd": fp.PdGravity(60, 12),
    "computed torque": fp.ComputedTorque(64, 16), "sliding mode": fp.SlidingMode(8, 10),
    "Slotine-Li": fp.SlotineLi(8, 6, 0.5),
}  # fmt: skip


def experiment(**others):
    return fp.Experiment(ARM, fp.references.Sinusoid(0.4), duration=0.4, **others)


def test_its_terms_have_the_shapes_of_all_arms_and_the_values_of_a_pendulum():
    q, v, a = [0.3], [0.7], [-0.2]
    inertia, weight = MASS * LENGTH**2, MASS * G * LENGTH * np.cos(0.3)
    assert ARM.tool_jacobian(q).shape == (6, 1)
    assert ARM.tool_jacobian(q)[:3, 0] == pytest.approx(
        LENGTH * np.array((-np.sin(0.3), 0, np.cos(0.3)))
    )
    assert ARM.inverse_dynamics(q, v, a) == pytest.approx([inertia * a[0] + weight])
    assert ARM.mass_matrix(q) == pytest.approx(np.array([[inertia]]))
    assert ARM.coriolis_matrix(q, v).shape == (1, 1)


@pytest.mark.parametrize("dynamics", ["pinocchio", "compiled"])
def test_all_laws_follow_with_it(dynamics, tmp_path):
    runs = fp.simulate(experiment(dynamics=dynamics), list(LAWS.values()))
    for run in runs:
        assert run.outcome.completed
        assert run.q.shape == (401, 1)
    runs[0].save(tmp_path / "run.npz")
    assert fp.Run.load(tmp_path / "run.npz").arm == ARM
    fp.view.export_html(runs[0], tmp_path / "run.html")
    fp.view.plot(runs[0])


def test_it_is_judged_tuned_stepped_and_made_a_campaign_and_c_of(tmp_path):
    law = LAWS["fpid"]
    assert fp.stability_report(ARM, law, step=1e-3).stable
    assert fp.control.gain_ceilings(ARM, law, step=1e-3).kp.shape == (1,)
    space = Space(integral_order=(0, 1), derivative_order=(0, 1))
    settings = SearchSettings(population=4, generations=2)
    assert fp.tune(experiment(), law, space, settings=settings).controller.kp.shape == (1,)
    assert law.start(ARM, step=1e-3).torque([0.1], [0.0], [0.2], [0.0], [0.0]).shape == (1,)
    plants = campaign.Scenarios({"payload": campaign.Uniform(low=0.0, high=0.3)}, seed=1)
    study = campaign.Study(experiment(dynamics="compiled"), {"fpid": law}, plants)
    data = campaign.run(study, tmp_path / "ledger", 4)
    assert data.runs == 4
    folder = fp.export_c(law, ARM, 1e-3, tmp_path / "c", horizon=5.0, ticks=20)
    assert (folder / "vectors.bin").exists()


def test_init_writes_what_compare_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.xml").write_text(MJCF)
    assert main(["init", "one.xml"]) == 0
    text = (tmp_path / "config.toml").read_text()
    assert len(text.splitlines()) < 105
    (tmp_path / "config.toml").write_text(text.replace("duration = 10.0", "duration = 0.05"))
    assert main(["compare", "config.toml", "--no-figures"]) == 0
    printed = capsys.readouterr().out
    for part in ("FPID + feedforward + observer", "computed torque", "noise", "delay 2 ms"):
        assert part in printed
    assert len(list((tmp_path / "runs" / "config").glob("*.npz"))) == 30
    assert main(["inspect", "one.xml"]) == 0
    assert "one: 1 joint, gravity 9.81" in capsys.readouterr().out
