"""The suggested observer: what its rule promises, seen in the simulation."""

import dataclasses
import functools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import suggest_observer
from fpid_pin.exceptions import FpidWarning
from fpid_pin.references import Hold, Sinusoid

STEP = 1e-3


def arm_of(name):
    return fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)


@functools.cache
def suggested(name):
    arm = arm_of(name)
    law = fp.suggest_gains(arm, adaptive=False)
    return arm, law, suggest_observer(arm, law)


def following(arm, duration, **others):
    reference = Sinusoid(0.3, 2.0, phase=np.linspace(0, np.pi, arm.n), offset=arm.home)
    v0 = reference.sample(np.zeros(1))[1][0]
    return fp.Experiment(arm, reference, v0=v0, duration=duration, **others)


@pytest.mark.parametrize("name", ["two_link", "ur5"])
def test_noise_makes_the_torque_vary_by_as_much_more_as_was_allowed(name):
    arm, law, omega = suggested(name)
    assert 20.0 < omega < 300.0
    sensors = fp.Sensors(velocity_noise=0.05)
    experiment = fp.Experiment(
        arm, Hold(arm.home), sensors=sensors, duration=1.0, dynamics="compiled"
    )
    both = [law, dataclasses.replace(law, observer=omega)]
    alone, observed = (r.metrics.total_variation.sum() for r in fp.simulate(experiment, both))
    # The rule looks at the newest sample of noise only; older ones are a few hundredths.
    assert observed / alone == pytest.approx(1.25, abs=0.03)


def test_every_law_may_have_one():
    """Noise is what binds here; an FPID of orders 1 is a PID, and computed torque has k1 M."""
    arm = arm_of("two_link")
    fpid = fp.AdaptiveFpid(100.0, 200.0, 20.0, learning_rate=0.0, scale="inertia")
    found = [suggest_observer(arm, x) for x in (fpid, fp.Pid(100.0, 200.0, 20.0, scale="inertia"))]
    assert found[0] == pytest.approx(found[1], rel=1e-9)
    # Observer and law answer noise with l2 M and k1 M, so the sums are in proportion.
    omega = suggest_observer(arm, fp.ComputedTorque(100.0, 20.0))
    gain = (1.0 - np.exp(-omega * STEP)) ** 2 / STEP
    assert np.hypot(20.0 + gain, 20.0) == pytest.approx(1.25 * np.hypot(20.0, 20.0), rel=1e-6)


def test_late_measurements_cost_bandwidth_and_then_all_of_it():
    arm, law, omega = suggested("two_link")
    assert omega >= suggest_observer(arm, law, delay=0.004) > 0.0
    with pytest.warns(FpidWarning, match="two_link: the law alone is not stable .* 60 ms late"):
        assert suggest_observer(arm, law, delay=0.06) == 0.0
