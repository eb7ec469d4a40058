"""What the rivals have against a wrong model: integrals, and the observer that the FPID has."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.disturbances import Pulse
from fpid_pin.references import Hold, Sinusoid

STEP, OMEGA, LOAD = 1e-3, 60.0, 0.7
ROD = fp.Arm.planar([1.0], [2.0], gravity=0.0)  # M = 2 kg m^2
ARM = fp.Arm.two_link()
OBSERVED = [
    fp.ComputedTorque(k0=100.0, k1=20.0, ki=30.0, observer=OMEGA),
    fp.PdGravity(kp=100.0, kd=20.0, scale="inertia", ki=30.0, observer=OMEGA),
    fp.SlidingMode(slope=10.0, gain=20.0, boundary_layer=2.0, scale="inertia", observer=OMEGA),
]
NAMES = [type(law).__name__ for law in OBSERVED]


def pushed(duration, load=LOAD):
    plant = fp.Plant(disturbance=Pulse(load))
    return fp.Experiment(ROD, Hold(0.0), plant=plant, duration=duration)


def following(arm, duration, **others):
    reference = Sinusoid(0.3, 2.0, phase=np.linspace(0, 1, arm.n), offset=arm.home)
    v0 = reference.sample(np.zeros(1))[1][0]
    return fp.Experiment(arm, reference, v0=v0, duration=duration, **others)


@pytest.mark.parametrize("friction", [0.0, 0.1, 5.0])
@pytest.mark.parametrize("law", OBSERVED, ids=NAMES)
def test_a_constant_torque_is_cancelled_by_its_closed_form(law, friction):
    """Whatever viscous friction, which is given as h F_v/M: beyond 1 it stops a joint in a step."""
    law = dataclasses.replace(law, **({"ki": 0.0} if hasattr(law, "ki") else {}))
    rod = ROD.with_friction(viscous=2.0 * friction / STEP)
    # The scale "inertia", and the model's part, are of M alone.
    run = fp.simulate(dataclasses.replace(pushed(1.5), arm=rod), law)
    p, k = np.exp(-OMEGA * STEP), np.arange(len(run.t))
    found = LOAD * (1.0 - p**k * (1.0 + (1.0 - p) * k))
    # Each of the three is M (100 e + 20 e') beside it: the sliding mode, inside its layer, has
    # the slope 10 once in its model and once in its surface, times 20/2.
    feedback = 2.0 * (100.0 * run.error[:, 0] + 20.0 * (run.v_ref - run.v)[:, 0])
    assert np.abs(run.torque[:, 0] - feedback + found).max() < 1e-10
    assert friction or np.abs(run.error[-1]).max() < 1e-8


@pytest.mark.parametrize("name", ["z1", "xarm7"])
def test_an_arm_whose_friction_stops_joints_within_a_step_bears_an_observer(name):
    arm = fp.Arm.from_example(name)
    assert (STEP * arm.viscous_friction > 2.0 * np.diag(arm.mass_matrix(arm.home))).any()
    experiment = following(arm, 1.0, plant=fp.Plant(arm=arm.with_payload(0.3)), dynamics="compiled")
    for law in (*OBSERVED, fp.Pid(100.0, 200.0, 20.0, scale="inertia", observer=30.0)):
        slow = dataclasses.replace(law, observer=30.0)
        run, alone = fp.simulate(experiment, [slow, dataclasses.replace(law, observer=0.0)])
        assert run.outcome.completed
        assert np.linalg.norm(run.metrics.rms) < 1.1 * np.linalg.norm(alone.metrics.rms)
