"""`inspect` and `init`: what a first user asks of an arm, and a configuration that runs."""

import dataclasses
import os
import tomllib
from pathlib import Path

import numpy as np
import pytest
from robots import LIFTER, joint, link, robot, write

import fpid_pin as fp
from fpid_pin.arms import Arm
from fpid_pin.cli.arms import frictions, oddities, payload, rounded, swing
from fpid_pin.cli.campaign import read_campaign
from fpid_pin.cli.configuration import load
from fpid_pin.cli.main import main
from fpid_pin.cli.tune import read_plan
from fpid_pin.simulation import limit_report

INITIAL = [
    "FPID + feedforward + observer", "integer PID + feedforward + observer", "FPID", "integer PID",
    "PD + gravity", "computed torque",
]  # fmt: skip
LIMIT = '<limit lower="-3" upper="3" effort="40" velocity="9"/>'
WEAK = robot(
    link("base"), link("rod", 20, (0.02, 0.5, 0.5), com="0.5 0 0"),
    link("end", 20, (0.02, 0.5, 0.5), com="0.5 0 0"),
    joint("hinge", "base", "rod", extra=LIMIT), joint("knee", "rod", "end", extra=LIMIT),
)  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write(tmp_path, LIFTER, "lifter.xml")
    return tmp_path


def rows_below(printed, start):
    """Return the cells of the table below a line, row by row, without the numbers."""
    lines = printed.splitlines()
    at = next(k for k, line in enumerate(lines) if line.startswith(start))
    head = next(k for k in range(at, len(lines)) if lines[k].lstrip().startswith("#"))
    rows = []
    for line in lines[head + 1 :]:
        if not line or not line.split()[0].isdigit():
            break
        rows.append(line.split()[1:])
    return rows


def fits_80_columns(printed):
    """Return whether nothing is wider, or cut."""
    return max(map(len, printed.splitlines())) <= 80 and "..." not in printed and "…" not in printed


def test_it_says_what_the_arm_and_its_law_are(capsys):
    assert main(["inspect", "kinova", "--bandwidth", "8"]) == 0
    printed = capsys.readouterr().out
    assert fits_80_columns(printed)
    arm = Arm.from_example("kinova")
    law = fp.suggest_gains(arm, 8.0)
    joints = rows_below(printed, "Joints and their limits")
    assert [row[-1] for row in joints] == list(arm.joint_names)
    assert [float(row[4]) for row in joints] == pytest.approx(arm.effort_limit, rel=1e-3)
    home = np.array([[float(cell) for cell in row[:2]] for row in rows_below(printed, "At home")])
    assert home[:, 0] == pytest.approx(arm.home, rel=1e-3)
    assert home[:, 1] == pytest.approx(np.diag(arm.mass_matrix(arm.home)), rel=1e-3)
    gains = np.array([[float(cell) for cell in row] for row in rows_below(printed, "Suggested")])
    ceilings = fp.control.gain_ceilings(arm, law)
    expected = [
        law.scale_on(arm), law.integral_order, law.derivative_order, law.kp, law.ki, law.kd,
        ceilings.kp, ceilings.ki, ceilings.kd,
    ]  # fmt: skip
    columns = np.column_stack([np.broadcast_to(x, arm.n) for x in expected])
    assert gains == pytest.approx(columns, rel=1e-3)
    margins = rows_below(printed, "Margins at home")
    report = fp.stability_report(arm, law)
    assert [float(row[0]) for row in margins] == pytest.approx(report.gain_margin, rel=1e-3)
    assert ("stable" in printed) == report.stable
    notes = fp.control.explain_gains(arm, 8.0).notes
    assert notes
    assert all(note in " ".join(printed.split()) for note in notes)
    assert "Nothing had to be lowered" not in printed


def test_metres_and_newtons_are_said(folder, capsys):
    assert main(["inspect", "lifter.xml"]) == 0
    printed = capsys.readouterr().out
    assert fits_80_columns(printed)
    assert "of prismatic joints m, m/s and N)" in " ".join(printed.split())
    kinds = [row[0] for row in rows_below(printed, "Joints")]
    assert kinds == ["revolute", "prismatic", "revolute"]
    assert main(["inspect", "lifter.xml", "--lock", "slide=0.2", "--picture", "arm.svg"]) == 0
    printed = capsys.readouterr().out
    assert "prismatic" not in printed
    assert "Written: arm.svg" in printed
    assert (folder / "arm.svg").stat().st_size > 5000


@pytest.mark.filterwarnings("ignore:.*cannot hold the arm there")
def test_what_looks_wrong_is_flagged(capsys):
    assert main(["inspect", "bravo7_no_ee"]) == 0
    printed = capsys.readouterr().out
    assert fits_80_columns(printed)
    told = "- bravo7_no_ee: joint joint2: gravity at home is 9.67 N m, beyond its effort limit"
    assert told in " ".join(printed.split())
    planar = Arm.planar((1, 1, 1), (1, 30, 2), gravity=0)
    assert [*oddities(planar)] == ["the link outweighs its neighbours more than 10 times: joint2"]
    arm = (
        planar.with_friction((0, 1e7, 0))
        .with_scaled_links((1, 0.1, 1))
        .with_limits(velocity=10, lower=(-1, 1, -1), upper=(2, 2, 180))
    )
    assert [*oddities(arm)] == [
        "the speed limits of all joints are 10, as drafts have them",
        "position limits beyond 20 rad, perhaps meant in degrees: joint3",
        "viscous friction holds the joint, which --lock would do better: joint2",
        "the zero pose is outside the limits: joint2",
    ]
    assert [*oddities(Arm.from_example("ur5"))] == []


def test_the_rest_of_a_tree_is_held_by_the_tip_of_the_arm(folder, capsys):
    body = '<inertial pos=".1 0 0" mass="1" diaginertia=".1 .1 .1"/>'
    fingers = [f'<body name="{x}"><joint name="{x} 1" type="slide"/>{body}</body>' for x in "fg"]
    Path("hand.xml").write_text(
        f'<mujoco><worldbody><body name="h"><joint name="j" axis="0 1 0"/>{body}{"".join(fingers)}'
        "</body></worldbody></mujoco>"
    )
    assert main(["inspect", "hand.xml"]) == 2
    hint = "(--keep h or --lock 'f 1'=0 --lock 'g 1'=0)"
    assert capsys.readouterr().err.endswith(f"branches at joint 'j' into 'f 1', 'g 1' {hint}\n")
    assert main(["inspect", "hand.xml", "--keep", "h", "--tool", "f"]) == 0
    assert "hand: 1 joint," in capsys.readouterr().out
    assert main(["init", "hand.xml", "--keep", "h", "--out", "hand.toml"]) == 0
    table = tomllib.loads(Path("hand.toml").read_text())["arm"]
    assert table == {"kind": "mjcf", "path": "hand.xml", "keep": "h"}


@pytest.mark.parametrize("name", ["ur5", "lifter.xml"])
def test_a_configuration_stays_within_the_limits_of_its_arm_and_every_law_follows(folder, name):
    assert main(["init", name]) == 0
    config = load(folder / "config.toml")
    arm, t = config.experiment.arm, np.linspace(0.0, 10.0, 500)
    q, v, _ = config.experiment.reference.sample(t)
    assert ((q > arm.lower) & (q < arm.upper)).all()
    assert (np.abs(v) <= arm.velocity_limit).all()
    assert (np.ptp(q, axis=0) > 0.0).all()
    assert list(config.controllers) == INITIAL
    kinds = [condition.split()[0] for condition in config.conditions]
    assert kinds == ["nominal", "payload", "friction", "noise", "delay"]
    # The same file says what `tune` and `campaign run` do.
    plan, (study, runs) = read_plan(config), read_campaign(config)
    assert list(plan.experiments) == list(config.conditions)
    assert isinstance(plan.controller, fp.AdaptiveFpid)
    assert (list(study.controllers), runs) == (INITIAL, 1000)
    if name == "lifter.xml":
        return  # its drives are weak
    experiment = dataclasses.replace(config.experiment, dynamics="compiled")
    for run in fp.simulate(experiment, list(config.controllers.values())):
        assert run.outcome.completed
        assert limit_report(run) == []
        assert run.metrics.rms_tail.max() < 0.05


def test_paths_start_at_the_configurations_folder_and_odd_names_stay_text(folder):
    odd, start = 'lift"er\n[x].xml', folder / "deep" / "er" / "start.toml"
    os.rename("lifter.xml", odd)
    assert main(["init", odd, "--out", str(start), "--lock", "wrist=0.1"]) == 0
    table = tomllib.loads(start.read_text())["arm"]
    assert table == {"kind": "mjcf", "path": f"../../{odd}", "lock": {"wrist": 0.1}}
    assert load(start).experiment.arm == Arm.from_mjcf(odd, {"wrist": 0.1})
    assert "[rad] and [m]" in start.read_text()


@pytest.mark.parametrize("name", ["ur5", "so100"])
def test_what_is_asked_of_the_drives_can_be_borne(name):
    arm = Arm.from_example(name)
    heavier = arm.with_payload(payload(arm))
    spare = arm.effort_limit - np.abs(arm.gravity_vector(arm.home))
    carried = np.abs(heavier.gravity_vector(arm.home) - arm.gravity_vector(arm.home))
    assert (carried <= 0.31 * spare + 1e-9).all()
    viscous, dry = frictions(arm)
    assert (viscous > arm.viscous_friction).all()
    assert (dry < arm.effort_limit + arm.dry_friction).all()
    assert (swing(arm)[0] > 0.0).all()
    cut = [0.0, 0.29, 1.0, 0.034, 3.3, 120.0]
    assert rounded(np.array([0.0, 0.299, 1.0, 0.0349, 3.39, 128.0])).tolist() == cut


@pytest.mark.filterwarnings("ignore:made. joint::")
def test_init_says_first_what_an_arm_s_own_drives_cannot_hold(tmp_path, monkeypatch, capsys):
    """And suggests no payload that they would have to hold as well."""
    monkeypatch.chdir(tmp_path)
    weak = fp.Arm.planar([1.0], [20.0], gravity=9.8).with_limits(effort=40.0)
    assert payload(weak) <= 0.02
    assert payload(weak.with_limits(effort=400.0)) == pytest.approx(6.0)
    write(tmp_path, WEAK, "weak.urdf")
    assert main(["init", "weak.urdf", "--out", "weak.toml"]) == 0
    said = capsys.readouterr().out.splitlines()
    assert "joint hinge: gravity at home is 255 N m, beyond its effort limit of 40 N m" in said[0]
    assert "joint knee: gravity at home is 98.1 N m, beyond its effort limit of 40 N m" in said[1]
    assert main(["run", "weak.toml", "--controller", "FPID"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert [line.split("joint ")[1].split(":")[0] for line in lines] == ["hinge", "knee"]
    assert all(line.endswith("; it falls under any controller") for line in lines)
    assert not (tmp_path / "runs").exists()
