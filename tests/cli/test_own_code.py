"""Kinds of one's own, named by a configuration: run only where that is allowed."""

import contextvars
import sys
import textwrap
import warnings
from pathlib import Path

import numpy as np
import pytest
from bounded import finished

import fpid_pin as fp
from fpid_pin.cli import commands
from fpid_pin.cli.main import main
from fpid_pin.exceptions import ConfigError

OWN = """
from dataclasses import dataclass

import numpy as np

import fpid_pin as fp


@fp.described("my_pd")
@dataclass(frozen=True, eq=False)
class MyPd(fp.Controller):
    kp: float = 10.0
    kd: float = 2.0
    name: str = "mine"

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return self.kp * (q_ref - q) + self.kd * (v_ref - v) + state.arm.gravity_vector(q)


@fp.described("my_ramp", "Reference")
@dataclass(frozen=True, eq=False)
class Ramp:
    speed: float = 0.1

    def sample(self, t):
        q = self.speed * t[:, np.newaxis]
        return q, np.full_like(q, self.speed), np.zeros_like(q)


@fp.described("my_cost")
@dataclass(frozen=True, eq=False)
class Peak(fp.costs.Cost):
    def of(self, metrics):
        return float(metrics.peak_torque.max())
"""
CONFIG = """
format = 1
import = "own.py"
[arm]
kind = "two_link"
[reference]
kind = "my_ramp"
speed = 0.2
[simulation]
duration = 0.2
[[controller]]
kind = "my_pd"
kp = 30
[tune]
population = 4
generations = 1
profile_points = 0
[tune.cost]
kind = "my_cost"
[tune.space]
kp = [5, 50, "shared"]
"""
QUICK = ["--allow-import", "--no-figures"]


@pytest.fixture
def config(tmp_path):
    (tmp_path / "own.py").write_text(OWN)
    (tmp_path / "c.toml").write_text(CONFIG)
    return tmp_path / "c.toml"


def test_nothing_is_run_that_was_not_allowed_by_a_script_that_calls_commands(config, capsys):
    out = config.parent / "out"

    def script():
        with pytest.raises(ConfigError, match="expected --allow-import"):
            commands.run(config, out=out)
        commands.run(config, out=out, no_figures=True, allow_import=True)
        assert "mine" in capsys.readouterr().out
        assert fp.Run.load(out / "mine.npz").outcome.completed
        # What one call allowed, the next command does not.
        (config.parent / "own.py").rename(config.parent / "other.py")
        config.write_text(CONFIG.replace("own.py", "other.py"))
        with pytest.raises(ConfigError, match="expected --allow-import"):
            commands.tune(config, out=config.parent / "tuned")
        assert main(["run", str(config), "--out", str(out)]) == 2

    contextvars.copy_context().run(script)


def test_a_law_a_reference_and_a_cost_of_one_s_own(config, monkeypatch, capsys):
    monkeypatch.chdir(config.parent)
    assert main(["run", "c.toml", "--out", "out", *QUICK]) == 0
    run = fp.Run.load("out/mine.npz")
    assert run.q_ref[-1] == pytest.approx([0.04, 0.04])
    # Loaded again it is the same law, since this process knows its kind.
    assert type(run.controller).__name__ == "MyPd"
    assert run.controller.kp == 30
    # Where it is not known what is missing is named.
    code = "import fpid_pin as fp; fp.Run.load('out/mine.npz').controller"
    assert "my_pd" in finished([sys.executable, "-c", code]).stderr.splitlines()[-1]
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        # In processes, which must be told of the file as well.
        assert main(["tune", "c.toml", "--out", "tuned", "--allow-import", "--workers", "2"]) == 0
    assert "warning: MyPd is a law in plain Python: 4 candidates" in capsys.readouterr().err
    again = ["tuned/tuned.toml", "--controller", "tuned", "--out", "again"]
    assert main(["run", *again, *QUICK]) == 0
    peak = np.abs(fp.Run.load("again/tuned.npz").torque).max()
    assert f"{peak:.3g}"[:3] in Path("tuned/summary.md").read_text("utf-8")


def test_a_fault_in_one_s_own_code_is_a_line_with_its_place(config, monkeypatch, capsys):
    monkeypatch.chdir(config.parent)
    text = OWN.replace("self.speed * t", "self.sped * t")
    Path("own.py").write_text(text)
    assert contextvars.copy_context().run(main, ["run", "c.toml", "--out", "out", *QUICK]) == 2
    line = 1 + text.splitlines().index("        q = self.sped * t[:, np.newaxis]")
    said = f"own.py:{line}: AttributeError: 'Ramp' object has no attribute 'sped'"
    assert capsys.readouterr().err == f"fpid-pin: {said}\n"
    assert not Path("out").exists()


def test_workers_cannot_have_what_a_session_defines():
    code = textwrap.dedent("""
        from dataclasses import dataclass
        import fpid_pin as fp
        from fpid_pin.tuning import SearchSettings, Space

        @dataclass(frozen=True, eq=False)
        class Mine(fp.Controller):
            kp: float = 10.0
            def control(self, state, q, v, q_ref, v_ref, a_ref):
                return self.kp * (q_ref - q)

        e = fp.paper_experiment(duration=0.1)
        fp.tune(e, Mine(), Space(kp=(1, 20, "shared")),
                settings=SearchSettings(population=4, generations=1, workers=2))
    """)
    done = finished([sys.executable, "-c", code])
    last = done.stderr.strip().splitlines()[-1]
    assert "TuningError: workers: expected classes and functions of a module, got one that" in last
    assert "out of memory" not in done.stderr
