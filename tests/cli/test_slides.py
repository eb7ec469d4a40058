"""Joints that slide, through every command: metres and newtons, wherever there is a unit."""

import re

import pytest
from robots import joint, link, robot, write

import fpid_pin as fp
from fpid_pin.cli.main import main
from fpid_pin.text import head_for, unit_for

LIMIT = '<limit lower="-0.5" upper="0.5" effort="60" velocity="2"/>'
LAWS = """
[simulation]
duration = 0.2
[[controller]]
kind = "suggested_fpid"
[[controller]]
kind = "pd_gravity"
name = "PD"
kp = 100.0
kd = 20.0
scale = "inertia"
[campaign]
runs = 3
[campaign.uncertain]
viscous_friction = { kind = "uniform", low = 0.0, high = 1.0 }
q0 = { kind = "uniform", low = 0.0, high = 0.1, shared = true }
"""
#: Units of joints that turn; those of an oscillation, of a bandwidth and of a crossover stay.
TURNING = re.compile(r"\bm?rad\b(?!/s)|\bN m\b")


def study(folder, name, *joints):
    """Write an arm of joints (name, kind, axis), each on the last, and a study of it."""
    parts, parent = [link("base")], "base"
    for child, kind, axis in joints:
        parts += [link(child, 2), joint(child, parent, child, kind, LIMIT, axis, "0 0 0")]
        parent = child
    write(folder, robot(*parts), f"{name}.urdf")
    head = f'format = 1\n[arm]\nkind = "urdf"\npath = "{name}.urdf"\n'
    wave = '[reference]\nkind = "sinusoid"\namplitude = 0.1\n'
    (folder / f"{name}.toml").write_text(head + wave + LAWS)


@pytest.fixture
def told(tmp_path, monkeypatch, capsys):
    """Give a function that runs commands in a folder with both arms, and returns what they say."""
    study(tmp_path, "gantry", ("x", "prismatic", "1 0 0"), ("z", "prismatic", "0 0 1"))
    study(tmp_path, "scara", ("turn", "revolute", "0 0 1"), ("quill", "prismatic", "0 0 1"))
    monkeypatch.chdir(tmp_path)

    def run(*words):
        assert main([*words]) == 0
        return capsys.readouterr().out

    return run


def page(path):
    """Return what a page says, without its scripts and numbers of drawings."""
    text = re.sub(r"<(script|style|iframe|svg)\b.*?</\1>", "", path.read_text("utf-8"), flags=re.S)
    return text.partition("<h2>Configuration")[0]


def test_an_arm_that_only_slides_is_told_of_in_metres_and_newtons(told, tmp_path):
    texts = [told("inspect", "gantry.urdf"), told("compare", "gantry.toml", "--out", "out")]
    texts += [(tmp_path / "out" / name).read_text() for name in ("summary.md", "joints.csv")]
    texts += [page(tmp_path / "out" / "report.html")]
    texts += re.findall(r"<!-- (.*?) -->", (tmp_path / "out" / "comparison.svg").read_text())
    told("campaign", "run", "gantry.toml", "--out", "c.sqlite")
    told("campaign", "report", "c.sqlite", "--html", "c.html")
    texts += [page(tmp_path / "c.html")]
    told("playground", "gantry.toml", "--html", "p.html")
    texts += [page(tmp_path / "p.html")]
    # inspect says once of which unit which column is.
    units = "angles in rad, speeds in rad/s, efforts in N m"
    texts[0] = " ".join(texts[0].split()).replace(units, "")
    for text in texts:
        assert not TURNING.search(text), TURNING.search(text).string[-300:]
    assert "tail (rms of joints) [mm]" in texts[2]
    assert "peak torque [N]" in texts[3]


def test_an_arm_that_turns_and_slides_is_told_of_in_both(told, tmp_path):
    told("compare", "scara.toml", "--out", "out")
    summary = (tmp_path / "out" / "summary.md").read_text()
    assert "tail (rms of joints) [mrad or mm]" in summary
    assert "peak (worst joint) [N m or N]" in summary
    assert re.search(r"Least RMS error of the last half: .* [\d.]+ mrad or mm", summary)
    told("campaign", "run", "scara.toml", "--out", "c.sqlite")
    told("campaign", "report", "c.sqlite", "--html", "c.html")
    text = page(tmp_path / "c.html")
    for unit in ("viscous_friction.0, N m s/rad", "viscous_friction.1, N s/m", "q0, rad or m"):
        assert unit in text
    told("playground", "scara.toml", "--html", "p.html")
    assert "Error <small>rad or m</small>" in page(tmp_path / "p.html")


def test_a_slide_that_runs_away_does_so_in_metres_a_second():
    slide = joint("x", "base", "x", "prismatic", LIMIT, "1 0 0")
    arm = fp.Arm.from_urdf(urdf=robot(link("base"), link("x"), slide))
    pushed = fp.Plant(disturbance=fp.disturbances.Pulse(1e6))
    run = fp.simulate(
        fp.Experiment(arm, fp.references.Hold(0.0), plant=pushed), fp.Pid(0.0, 0.0, 0.0)
    )
    assert re.fullmatch(r"speed \S+ m/s is beyond 1000 m/s", run.outcome.cause)


@pytest.mark.parametrize(
    ("unit", "sliding"),
    [("mrad", "mm"), ("N m s/rad", "N s/m"), ("N²m²s", "N²s"), ("rad² s", "m² s"), ("s", "s"),
     (r"N m/(rad s$^\lambda$)", r"N/(m s$^\lambda$)"), ("N m/s", "N/s"), ("kg m^2", "kg m^2"),
     ("rad^2 s", "m^2 s"), ("%", "%")],
)  # fmt: skip
def test_the_unit_of_a_joint_that_slides(unit, sliding):
    assert unit_for(unit, ["rad", "rad"]) == unit
    assert unit_for(unit, ["m"]) == sliding
    both = unit if unit == sliding else f"{unit} or {sliding}"
    assert unit_for(unit, ["m", "rad"]) == both
    assert head_for(f"radius of N m [{unit}]", ["m"]) == f"radius of N m [{sliding}]"
