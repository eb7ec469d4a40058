"""Metrics against their definitions; streaming against recorded."""

import numpy as np
import pytest
from fpid_pin.simulation.lockstep import lockstep

import fpid_pin as fp
from fpid_pin.costs import METRIC_NAMES, MetricCost, QuadraticCost
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.metrics import MetricsRecorder


@pytest.fixture(scope="module")
def run():
    return fp.simulate(fp.paper_experiment(duration=1.5), fp.paper_controller())


def test_they_are_what_they_say(run):
    h, m = 1e-3, run.metrics
    e, u, t = run.error[:-1], run.torque[:-1], run.t[:-1, np.newaxis]
    expected = {
        "ise": h * (e**2).sum(0),
        "iae": h * np.abs(e).sum(0),
        "itae": h * (t * np.abs(e)).sum(0),
        "rms": np.sqrt((e**2).mean(0)),
        "rms_tail": np.sqrt((e[750:] ** 2).mean(0)),
        "energy": h * (u**2).sum(0),
        "total_variation": np.abs(np.diff(u, axis=0)).sum(0),
        "peak_torque": np.abs(u).max(0),
    }
    for name, value in expected.items():
        assert np.allclose(getattr(m, name), value, rtol=1e-12), name


def test_the_last_torque_is_recorded_and_not_counted(run):
    assert len(run.t) == 1501
    assert run.planned_rows == 1501


def test_streamed_metrics_have_the_bits_of_the_record_s(run):
    recorder = MetricsRecorder()
    lockstep([fp.paper_experiment(duration=1.5)], [fp.paper_controller()], [recorder])
    streamed = recorder.result()[0]
    for name in METRIC_NAMES:
        assert (getattr(streamed, name) == getattr(run.metrics, name)).all()


def test_costs_weigh_joints_as_told(run):
    m = run.metrics
    cost = QuadraticCost(w1=2.0, w2=1e-3, joint_weights=(1.0, 3.0))
    assert cost.of(m) == pytest.approx(((2 * m.ise + 1e-3 * m.energy) * [1.0, 3.0]).sum())
    assert MetricCost("iae").of(m) == pytest.approx(m.iae.sum())
    with pytest.raises(ArgumentError, match=r"cost.metric: .* \(did you mean itae\?\)"):
        MetricCost("itea")
    with pytest.raises(ArgumentError, match="cost.w1: expected a number >= 0, got -1"):
        QuadraticCost(w1=-1.0)
