"""Feedforward and disturbance observer: what they cancel, how exactly; how fast it should be."""

import dataclasses
import functools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.control import suggest_observer
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import FpidWarning
from fpid_pin.references import Hold, Sinusoid

STEP, OMEGA, LOAD = 1e-3, 60.0, 0.7
ROD = fp.Arm.planar([1.0], [2.0], gravity=0.0)  # M = 2 kg m^2, nothing else
LAW = fp.AdaptiveFpid(kp=200.0, ki=0.0, kd=40.0, learning_rate=0.0)
#: Inside its layer the sliding mode has the slope 10 once in its model and once in its surface,
#: times 20/2: beside the observer each of these asks for M (100 e + 20 e') of the rod.
OBSERVED = [
    dataclasses.replace(LAW, observer=OMEGA),
    fp.ComputedTorque(k0=100.0, k1=20.0, observer=OMEGA),
    fp.PdGravity(kp=100.0, kd=20.0, scale="inertia", observer=OMEGA),
    fp.SlidingMode(slope=10.0, gain=20.0, boundary_layer=2.0, scale="inertia", observer=OMEGA),
]


def following(arm, duration, *, frequency=2.0, **others):
    """Return an experiment that starts on its reference."""
    phase = np.linspace(0.0, np.pi, arm.n, endpoint=False)
    reference = Sinusoid(0.3, frequency, phase=phase, offset=arm.home)
    v0 = reference.sample(np.zeros(1))[1][0]
    return fp.Experiment(arm, reference, v0=v0, duration=duration, **others)


def with_model(law, observer=0.0):
    return dataclasses.replace(law, feedforward=True, observer=observer)


def tail(run):
    return float(np.sqrt(np.mean(run.metrics.rms_tail**2)))


@pytest.mark.parametrize("step", [1e-3, 5e-4])
def test_on_the_exact_model_the_error_is_that_of_the_integration_rule(step):
    # Per unit of inertia e'' + kd e' + kp e = -kd (h/2) q''_d + O(h^2): the rule's rates are half a
    # step behind its angles. So |e| <= (h/2) (kd/kp) sup |q''_d|, and the size of a sinusoid is
    kp, kd, w = 100.0, 20.0, 2.0
    size = 0.5 * step * kd * 0.3 * w**2 / abs(kp - w**2 + 1j * kd * w)
    run = fp.simulate(following(ROD, 4 * np.pi, step=step), with_model(LAW))
    error = np.abs(run.error[len(run.t) // 2 :]).max()
    assert error == pytest.approx(size, rel=0.01)
    assert np.abs(run.error).max() < 1.01 * 0.5 * step * kd / kp * 0.3 * w**2


@pytest.mark.parametrize("friction", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("law", OBSERVED, ids=lambda law: type(law).__name__)
def test_a_constant_torque_is_cancelled_by_its_closed_form(law, friction):
    """Whatever viscous friction, which is given as h F_v/M: beyond 1 it stops a joint in a step."""
    rod = ROD.with_friction(viscous=2.0 * friction / STEP)
    plant = fp.Plant(disturbance=Pulse(LOAD))
    run = fp.simulate(fp.Experiment(rod, Hold(0.0), plant=plant, duration=1.5), law)
    # Both poles are p, from rest.
    p, k = np.exp(-OMEGA * STEP), np.arange(len(run.t))
    found = LOAD * (1.0 - p**k * (1.0 + (1.0 - p) * k))
    feedback = 2.0 * (100.0 * run.error[:, 0] + 20.0 * (run.v_ref - run.v)[:, 0])
    assert np.abs(run.torque[:, 0] - feedback + found).max() < 1e-10
    assert friction or np.abs(run.error[-1]).max() < 1e-8


def test_a_true_arm_that_is_too_light_is_where_the_closed_form_puts_it():
    # An arm of beta times the model's mobility: z^2 - (1 + p^2 - beta (1 - p)^2) z + p^2 = 0,
    # which leaves the unit circle at beta = 2 (1 + p^2)/(1 - p)^2.
    omega = 1.0 / STEP
    p = np.exp(-omega * STEP)
    edge = 2.0 * (1.0 + p**2) / (1.0 - p) ** 2
    law = fp.AdaptiveFpid(kp=0.0, ki=0.0, kd=0.0, learning_rate=0.0, observer=omega)
    push = Pulse(LOAD, 0.0, 0.01)
    peaks = []
    for mass in (2.0 / (0.95 * edge), 2.0 / (1.05 * edge)):
        plant = fp.Plant(arm=fp.Arm.planar([1.0], [mass], gravity=0.0), disturbance=push)
        run = fp.simulate(fp.Experiment(ROD, Hold(0.0), plant=plant, duration=0.4), law)
        peaks.append(np.abs(run.u_model[-50:]).max() / np.abs(run.u_model[:50]).max())
    assert peaks[0] < 1e-3 < 10.0 < peaks[1]


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_what_the_model_lacks_costs_a_small_part_of_the_error(name):
    arm = fp.Arm.from_example(name)
    law = fp.suggest_gains(arm, adaptive=False)
    size = np.asarray(law.scale)
    quiet = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)
    loud = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, delay=2)
    heavy = fp.Plant(arm=arm.with_payload(3.0))
    rough = fp.Plant(viscous_friction=size, dry_friction=0.5 * size)
    for plant, sensors, part in ((heavy, quiet, 0.1), (rough, quiet, 0.1), (heavy, loud, 0.15)):
        experiment = following(arm, np.pi, plant=plant, sensors=sensors, dynamics="compiled")
        both, alone = fp.simulate(experiment, [with_model(law, 100.0), law])
        assert tail(both) < part * tail(alone)


def arm_of(name):
    return fp.Arm.two_link() if name == "two_link" else fp.Arm.from_example(name)


@functools.cache
def suggested(name):
    arm = arm_of(name)
    law = fp.suggest_gains(arm, adaptive=False)
    return arm, law, suggest_observer(arm, law)


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
    # A part of a step counts as a whole one, a whole one as no more.
    some = suggest_observer(arm, law, delay=3.5 * STEP)
    assert some == suggest_observer(arm, law, delay=4.0 * STEP)
    assert some > suggest_observer(arm, law, delay=4.5 * STEP)
    with pytest.warns(FpidWarning, match="two_link: the law alone is not stable .* 60 ms late"):
        assert suggest_observer(arm, law, delay=0.06) == 0.0
