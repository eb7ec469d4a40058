"""Numbers, records, and stretches of a run with their figures of merit."""

import dataclasses

import numba
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from own_laws import Many

import fpid_pin as fp
from fpid_pin.kernels import functions, rollout
from fpid_pin.kernels.records import record_type
from fpid_pin.references import Sinusoid

pytestmark = pytest.mark.kernels


@given(st.one_of(st.floats(-1e9, 1e9), st.integers(-1000, 1000).map(lambda k: k + 0.5)))
def test_numbers_are_rounded_as_numpy_does_and_have_its_signs(x):
    """How they are clipped, and what winds up, is in tests/control."""
    assert rollout.rounded(x) == np.rint(x)
    assert functions.sign(x) == np.sign(x)


def test_a_name_that_a_record_has_already_is_refused():
    kind = record_type({"a": "one", "b": "two"}, {"c": "a count"})
    assert kind.names == ("a", "b", "c")
    record = np.zeros(1, kind)[0]
    record.a, record.c = 2.5, 3.0
    assert (record.a, record.c) == (2.5, 3)
    assert kind["c"] == np.int64
    with pytest.raises(ValueError, match="mean"):
        record_type({"a": "", "mean": ""})


ARM = fp.Arm.planar((0.5, 0.4, 0.3), (1.0, 0.8, 0.5)).with_friction(viscous=0.1)
#: Without compilation (test_line_by_line) a few ticks go through every branch.
DURATION = 0.012 if numba.config.DISABLE_JIT else 0.03
BASE = fp.Experiment(ARM, Sinusoid(0.4, 3.0), q0=0.05, v0=1.1, duration=DURATION)
NOISE = fp.Sensors(1e-3, 1e-4, velocity="differentiated", delay=2)
RUBS = fp.Plant(ARM.with_payload(0.3), dry_friction=(0.5, 0.2, 0.1), effort_limit=(40.0, 20.0, 5.0))
FPID = fp.AdaptiveFpid(40.0, 20.0, 4.0, 0.8, 0.7, design=fp.fractional.ExponentialSum(8))


STRETCHES = {
    "FPID": (BASE, FPID),
    "FPID, adaptive orders, Runge-Kutta": (
        dataclasses.replace(BASE, integrator="rk4"),
        dataclasses.replace(FPID, order_learning_rate=0.1),
    ),
    "FPID, noise and friction": (
        dataclasses.replace(BASE, sensors=NOISE, plant=RUBS),
        dataclasses.replace(FPID, feedforward=True, supervisor=fp.Supervisor.quiet(0.8, 0.7)),
    ),
    "Slotine-Li": (dataclasses.replace(BASE, plant=RUBS), fp.SlotineLi(5.0, 5.0)),
    "operators of its own surface": (BASE, Many(mu=0.7, scale=0.02)),
    "weight, late": (
        dataclasses.replace(BASE, q0=0.0, sensors=fp.Sensors(delay=1)),
        fp.GravityOnly(),
    ),
    "computed torque": (BASE, fp.ComputedTorque(60.0, 15.0)),
}


@pytest.mark.parametrize("name", STRETCHES)
def test_a_stretch_is_the_run_that_pinocchio_and_python_make_tick_by_tick(name):
    experiment, law = STRETCHES[name]
    runs = [
        fp.simulate(dataclasses.replace(experiment, dynamics=dynamics), law)
        for dynamics in ("compiled", "pinocchio")
    ]
    for array in ("q", "v", "torque", *runs[0].signals):
        found, expected = (getattr(run, array) for run in runs)
        assert np.abs(found - expected).max() < 1e-11 * max(1.0, np.abs(expected).max()), array
    for figure in fp.costs.METRICS:
        found, expected = (getattr(run.metrics, figure) for run in runs)
        assert found == pytest.approx(expected, rel=1e-9, abs=1e-9), figure
    assert np.abs(np.diff(runs[0].torque, axis=0)).min(axis=1).max() > 0.0


@pytest.mark.parametrize(("torque", "speed"), [(1.7e308, 1e3), (50.0, 3.0)])
def test_a_stretch_ends_where_a_number_is_lost_or_a_joint_runs_away(torque, speed):
    law = fp.Pid(torque, 0.0, 0.0)
    weak = fp.Plant(effort_limit=(5.0, np.inf, np.inf))
    experiment = dataclasses.replace(
        BASE, q0=1.5, plant=weak, dynamics="compiled", runaway_speed=speed
    )
    run = fp.simulate(experiment, law)
    other = fp.simulate(dataclasses.replace(experiment, dynamics="pinocchio"), law)
    assert not run.outcome.completed
    assert run.outcome == other.outcome
    assert np.array_equal(run.metrics.saturated, other.metrics.saturated, equal_nan=True)
    assert len(run.t) == round(run.outcome.time / run.step) <= round(DURATION / run.step)
