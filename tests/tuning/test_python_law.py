"""A law in plain Python in a search: the same search, and a word about how long it takes."""

import dataclasses
import time
import warnings
from types import SimpleNamespace

import pytest
from numpy.typing import ArrayLike

import fpid_pin as fp
from fpid_pin.tuning import SearchSettings, Space, search, tune

EXPERIMENT = fp.paper_experiment(duration=0.1, step=5e-3)
SPACE = Space(kp=(10, 100, "log"), kd=(1, 20))


@dataclasses.dataclass(frozen=True, eq=False)
class PythonPd(fp.Controller):
    kp: ArrayLike = 50.0
    kd: ArrayLike = 10.0

    def control(self, state, q, v, q_ref, v_ref, a_ref):
        return self.kp * (q_ref - q) + self.kd * (v_ref - v)


@dataclasses.dataclass(frozen=True, eq=False)
class JointPd(fp.Controller):
    kp: ArrayLike = 50.0
    kd: ArrayLike = 10.0

    @staticmethod
    def torque(c):
        return c.kp * c.e + c.kd * c.e_dot


def test_it_says_before_the_search_how_long_it_takes(monkeypatch):
    clock = iter((0.0, 36.0))
    monkeypatch.setattr(
        search, "time", SimpleNamespace(perf_counter=lambda: next(clock), monotonic=time.monotonic)
    )
    settings = SearchSettings(population=4, generations=2)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        counts = []
        tune(EXPERIMENT, PythonPd(), SPACE, settings=settings,
             progress=lambda _: counts.append(len(caught)))  # fmt: skip
    (warning,) = caught
    assert warning.category is fp.FpidWarning
    assert str(warning.message) == (
        "PythonPd is a law in plain Python: 8 candidates of 36 s each take about "
        "0:04:48 (h:min:s); in the joint form, torque(c), it is compiled (CONTRIBUTING.md)"
    )
    assert warning.filename == __file__
    assert counts[0] == 1


def test_its_search_is_that_of_the_same_law_joint_by_joint():
    settings = SearchSettings(population=4, generations=2)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        joint = tune(EXPERIMENT, JointPd(), SPACE, settings=settings)
    shared = dataclasses.replace(settings, workers=2)
    with pytest.warns(fp.FpidWarning, match="plain Python"):
        python = tune(EXPERIMENT, PythonPd(), SPACE, settings=shared)
    assert python.history.best == pytest.approx(joint.history.best, rel=1e-9)
