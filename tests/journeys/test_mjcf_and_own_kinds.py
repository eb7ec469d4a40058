"""An arm of MuJoCo's format, with a law, a cost and a reference of one's own, by files alone."""

import sys

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.cli.main import main

MJCF = """<mujoco model="reacher">
  <compiler angle="radian" autolimits="true"/>
  <worldbody>
    <body name="upper">
      <joint name="shoulder" axis="0 1 0" range="-2.5 2.5" damping="0.2"/>
      <inertial pos="0.2 0 0" mass="2" diaginertia="0.01 0.03 0.03"/>
      <body name="lower" pos="0.4 0 0">
        <joint name="elbow" axis="0 1 0" range="-2.5 2.5" damping="0.1"/>
        <inertial pos="0.15 0 0" mass="1" diaginertia="0.005 0.01 0.01"/>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor joint="shoulder" ctrlrange="-40 40"/>
    <motor joint="elbow" ctrlrange="-20 20"/>
  </actuator>
</mujoco>
"""
OWN = '''
from dataclasses import dataclass

import numpy as np

import fpid_pin as fp


@fp.described("sway", "Reference")
@dataclass(frozen=True, eq=False)
class Sway:
    """0.3 (1 - cos 2t) rad in both joints: it starts at rest."""

    size: float = 0.3

    def sample(self, t):
        one = np.ones(2)
        q = np.outer(self.size * (1.0 - np.cos(2.0 * t)), one)
        v = np.outer(2.0 * self.size * np.sin(2.0 * t), one)
        a = np.outer(4.0 * self.size * np.cos(2.0 * t), one)
        return q, v, a


@fp.described("pd_of_mine")
@dataclass(frozen=True, eq=False)
class Mine(fp.Controller):
    kp: float = 60.0
    kd: float = 6.0
    name: str = "mine"

    uses_model = True

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.e_dot


@fp.described("calm")
@dataclass(frozen=True, eq=False)
class Calm(fp.costs.Cost):
    """Squared error, and a price on changing the torque."""

    def of(self, metrics):
        return float(metrics.ise.sum() + 1e-4 * metrics.total_variation.sum())
'''
CONFIG = """format = 1
import = "mine.py"
[arm]
kind = "mjcf"
path = "reacher.xml"
[reference]
kind = "sway"
[simulation]
duration = 0.5
[[controller]]
kind = "pd_of_mine"
[[controller]]
kind = "suggested_fpid"
[tune]
controller = "mine"
population = 6
generations = 2
[tune.cost]
kind = "calm"
[tune.space]
kp = [20, 200, "log", "shared"]
kd = [2, 30, "log", "shared"]
"""


@pytest.fixture
def place(tmp_path):
    for name, text in (("reacher.xml", MJCF), ("mine.py", OWN), ("config.toml", CONFIG)):
        (tmp_path / name).write_text(text)
    yield tmp_path
    sys.modules.pop("fpid_pin_own_mine", None)


def test_it_is_compared_tuned_and_run(place, capsys):
    config = str(place / "config.toml")
    assert len(CONFIG.splitlines()) <= 25
    assert main(["inspect", str(place / "reacher.xml")]) == 0
    told = capsys.readouterr().out
    assert "shoulder" in told
    assert max(map(len, told.splitlines())) <= 80
    allow = ["--allow-import"]
    assert main(["compare", config, "--out", str(place / "compared"), *allow]) == 0
    assert capsys.readouterr().out.startswith("Least RMS error of the last half: ")
    assert main(["tune", config, "--out", str(place / "tuned"), *allow]) == 0
    assert capsys.readouterr().out.startswith("From ")
    again = str(place / "again")
    assert main(["run", str(place / "tuned" / "tuned.toml"), "--out", again, *allow]) == 0
    run = fp.Run.load(place / "again" / "tuned.npz")
    assert run.arm.joint_names == ("shoulder", "elbow")
    assert run.arm.effort_limit == pytest.approx([40.0, 20.0])
    assert run.q_ref[-1] == pytest.approx(np.full(2, 0.3 * (1.0 - np.cos(1.0))))
    assert type(run.controller).__name__ == "Mine"
    # What was tuned for is what the run of the tuned law costs, and no more than the start's.
    from fpid_pin_own_mine import Calm

    summary = (place / "tuned" / "summary.md").read_text("utf-8")
    assert f"cost {Calm().of(run.metrics):.6g}" in summary
    start = fp.simulate(run.experiment, type(run.controller)())
    assert Calm().of(run.metrics) <= Calm().of(start.metrics)
