"""Stability of laws with integrals and observers: closed forms, and simulations made to break."""

import dataclasses

import numpy as np
import pytest
from own_laws import JointPid, PythonPid, own

import fpid_pin as fp
from fpid_pin.control import PdGravity, Pid, SlidingMode
from fpid_pin.control.frozen import linearised
from fpid_pin.control.observed import beside, observer_system
from fpid_pin.control.sampled import linear_arm
from fpid_pin.control.stability import stability_report
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold

STEP, OMEGA = 1e-3, 80.0
ONE = fp.Arm.planar([1.0], [1.0], gravity=0.0)  # a unit inertia
TWO = fp.Arm.planar([1.0, 0.8], [2.0, 1.0], gravity=0.0)
FPID = fp.AdaptiveFpid(
    kp=100.0, ki=200.0, kd=20.0, integral_order=0.9, derivative_order=0.9, learning_rate=0.0,
    scale="inertia", observer=OMEGA,
)  # fmt: skip
OBSERVED = [
    FPID,
    Pid(100.0, 300.0, 20.0, scale="inertia", observer=OMEGA),
    fp.ComputedTorque(k0=100.0, k1=20.0, ki=300.0, observer=OMEGA),
    PdGravity(kp=100.0, kd=20.0, ki=300.0, scale="inertia", observer=OMEGA),
    SlidingMode(slope=10.0, gain=20.0, boundary_layer=2.0, scale="inertia", observer=OMEGA),
]


def shaken(arm, law, late):
    experiment = fp.Experiment(
        arm, Hold(arm.home), v0=np.full(arm.n, 1e-6), duration=3.0, sensors=fp.Sensors(delay=late)
    )
    run = fp.simulate(experiment, law)
    if not run.outcome.completed:
        return np.inf
    return np.abs(run.v[-500:]).max() / np.abs(run.v[:500]).max()


@pytest.mark.parametrize("law", OBSERVED, ids=lambda law: type(law).__name__)
def test_the_delay_that_is_borne_is_the_simulation_s(law):
    report = stability_report(TWO, law)
    assert report.stable
    samples = int(report.common_delay_margin / STEP)
    assert shaken(TWO, law, samples) < 1.0 < shaken(TWO, law, samples + 1)
    alone = stability_report(TWO, dataclasses.replace(law, observer=0.0))
    assert report.common_delay_margin < alone.common_delay_margin


@pytest.mark.parametrize("bandwidth", [5.0, 300.0])
def test_on_the_exact_model_an_observer_adds_two_poles_p_and_moves_none(bandwidth):
    arm = fp.Arm.two_link()
    # h F_v is 3 M_jj for one joint: friction stops it within a step.
    arm = arm.with_friction(viscous=np.diag(arm.mass_matrix(arm.home)) * (3.0, 0.1) / STEP)
    law = linearised(arm, PdGravity(kp=100.0, kd=20.0, scale="inertia"), STEP)
    plant = linear_arm(arm, arm.home, step=STEP, method="semi_implicit_euler")
    observed = beside(law, observer_system(arm, arm.home, bandwidth, STEP))
    found = np.sort_complex(np.linalg.eigvals(plant.closed(observed)))
    p = np.exp(-bandwidth * STEP)
    alone = np.append(np.linalg.eigvals(plant.closed(law)), [p, p, p, p])
    # A pole that is double comes out at the root of the rounding.
    assert found == pytest.approx(np.sort_complex(alone), abs=1e-5)


@pytest.mark.parametrize(
    "law", [fp.ComputedTorque(k0=100.0, k1=20.0), PdGravity(kp=100.0, kd=20.0)],
    ids=lambda law: type(law).__name__,
)  # fmt: skip
def test_an_integral_may_be_raised_to_routh_s_bound(law):
    # s^3 + 20 s^2 + 100 s + ki; a sample costs half a per cent.
    for ki, stable in ((1950.0, True), (2050.0, False)):
        report = stability_report(ONE, dataclasses.replace(law, ki=ki), step=1e-4)
        assert report.stable is stable
    same = stability_report(ONE, Pid(100.0, 500.0, 20.0))
    report = stability_report(ONE, dataclasses.replace(law, ki=500.0))
    assert report.phase_margin == pytest.approx(same.phase_margin, abs=1e-6)
    assert report.dominant_pole == pytest.approx(same.dominant_pole, rel=1e-6)


@pytest.mark.parametrize("form", [JointPid, PythonPid])
def test_the_integral_of_a_law_of_one_s_own_counts(form):
    for ki in (500.0, 2500.0):
        laws = form(100.0, 20.0, ki), Pid(100.0, ki, 20.0)
        own, pid = (stability_report(ONE, law) for law in laws)
        assert own.stable is pid.stable is (ki < 2000.0)
        assert own.delay_margin == pytest.approx(pid.delay_margin, rel=1e-6)


def test_what_a_torque_remembers_is_refused_and_what_adapts_stands_still():
    def filtered(c):
        c.rate += 0.1 * (c.e_dot - c.rate)
        return 50.0 * c.e + 10.0 * c.rate

    with pytest.raises(ArgumentError, match="its integral, got Own, whose rate is not"):
        stability_report(ONE, own(filtered, memory=("rate",)))

    def surface(c):
        c.push = 2.0 * c.e + c.e_dot

    def adapt(c):
        c.gain += c.h * c.push

    law = own(
        lambda c: c.gain * c.push + 10.0 * c.e, surface=surface, adapt=adapt,
        memory=("push", "gain"), numbers=lambda *_: {"gain": 20.0},
    )  # fmt: skip
    report, pid = (stability_report(ONE, x) for x in (law, Pid(50.0, 0.0, 20.0)))
    assert report.phase_margin == pytest.approx(pid.phase_margin, abs=1e-6)
