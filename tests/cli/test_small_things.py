"""What a first user stumbled over, each once."""

import fpid_pin as fp
from fpid_pin.cli.configuration import load
from fpid_pin.cli.main import main
from fpid_pin.simulation import Run
from fpid_pin.view import plots

HEAD = """
format = 1
[arm]
kind = "{arm}"
{more}
[reference]
{reference}
[simulation]
duration = 0.05
[[controller]]
kind = "suggested_fpid"
"""
SINE = 'kind = "sinusoid"\namplitude = 0.1'
UR5 = {"arm": "example", "more": 'name = "ur5"'}


def written(path, reference=SINE, tail="", arm="two_link", more=""):
    path.write_text(HEAD.format(arm=arm, more=more, reference=reference) + tail)
    return path


def refused(command, capsys):
    assert main([str(part) for part in command]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    return line


def test_the_version_and_a_short_help(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out == f"fpid-pin {fp.__version__}\n"
    for command in ([], ["tune"]):
        assert main([*command, "-h"]) == 0
        assert "Usage: " in capsys.readouterr().out


def test_a_parameter_that_all_joints_share_says_so(tmp_path, capsys):
    space = "[tune]\ngenerations = 1\n[tune.space]\nbandwidth = [0.5, 10]\n"
    config = written(tmp_path / "c.toml", tail=space)
    line = refused(["tune", config, "--out", tmp_path / "out"], capsys)
    assert 'tune.space.bandwidth: expected "shared" behind its bounds' in line
    # A bound that is wrong itself is told as that.
    config.write_text(config.read_text().replace("[0.5, 10]", '[-1, 10, "shared"]'))
    line = refused(["tune", config, "--out", tmp_path / "out"], capsys)
    assert "tune.space.bandwidth.low" in line


def test_a_key_of_an_arm_is_named_as_it_stands(tmp_path, capsys):
    config = written(tmp_path / "c.toml", more="lenghts = [1.0]")
    assert "arm.lenghts: expected one of" in refused(["run", config], capsys)


def test_a_circle_of_the_tool_is_one_of_the_configuration_s_arm(tmp_path):
    circle = 'kind = "tool_circle"\nradius = 0.1\nperiod = 2.0'
    config = load(written(tmp_path / "c.toml", circle, **UR5))
    assert config.experiment.reference.arm == fp.Arm.from_example("ur5")
    other = '[reference.arm]\nkind = "example"\nname = "ur5_limited"'
    config = load(written(tmp_path / "c.toml", f"{circle}\n{other}", **UR5))
    assert config.experiment.reference.arm == fp.Arm.from_example("ur5_limited")


def test_gains_of_suggested_laws_have_their_units(tmp_path):
    config = written(tmp_path / "c.toml")
    assert main(["run", str(config), "--out", str(tmp_path / "out")]) == 0
    run = Run.load(next((tmp_path / "out").glob("*.npz")))
    labels = [axes.get_ylabel() for axes in plots.gains(run).axes]
    assert labels[0] == "$K_P$, s$^{-2}$"
    plain = fp.simulate(fp.paper_experiment(duration=0.05), fp.paper_controller())
    assert plots.gains(plain).axes[0].get_ylabel() == "$K_P$, N m/rad"
