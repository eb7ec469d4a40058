"""What the rivals have against a wrong model: integrals, and the observer that the FPID has."""

import dataclasses

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.disturbances import Pulse
from fpid_pin.exceptions import ArgumentError
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


def without(law):
    off = {name: 0.0 for name in ("ki", "observer") if hasattr(law, name)}
    return dataclasses.replace(law, **off)


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


def test_an_integral_removes_what_stiffness_alone_leaves():
    plain = fp.ComputedTorque(k0=100.0, k1=20.0)
    pd = fp.PdGravity(kp=200.0, kd=40.0)
    for law, ki in ((plain, 200.0), (pd, 400.0)):
        alone, integral = fp.simulate(pushed(8.0), [law, dataclasses.replace(law, ki=ki)])
        assert alone.error[-1, 0] == pytest.approx(-LOAD / 200.0, rel=1e-6)
        assert abs(integral.error[-1, 0]) < 1e-6


@pytest.mark.parametrize("ki", [0.0, 80.0])
def test_it_is_the_observer_of_the_fpid(ki):
    # Two ways through the code, one law: gravity apart a PID with an observer.
    arm = fp.Arm.planar([1.0, 0.8], [1.0, 1.0], gravity=0.0).with_friction(viscous=0.3)
    rival = fp.PdGravity(kp=100.0, kd=20.0, scale="inertia", ki=ki, observer=OMEGA)
    fpid = fp.AdaptiveFpid(
        kp=100.0, ki=ki, kd=20.0, scale="inertia", learning_rate=0.0, observer=OMEGA
    )
    plant = fp.Plant(arm=arm.with_payload(0.7), dry_friction=0.4)
    sensors = fp.Sensors(velocity_noise=0.01, delay=1)
    experiment = following(arm, 1.0, plant=plant, sensors=sensors)
    first, second = fp.simulate(experiment, rival), fp.simulate(experiment, fpid)
    assert np.abs(first.torque - second.torque).max() < 1e-9 * np.abs(first.torque).max()


@pytest.mark.parametrize("law", OBSERVED, ids=NAMES)
def test_a_payload_costs_a_small_part_of_what_it_did(law):
    exact = following(ARM, 3.0)
    loaded = dataclasses.replace(exact, plant=fp.Plant(arm=ARM.with_payload(0.5)))
    costs = []
    for one in (law, without(law)):
        with_load, without_load = fp.simulate([loaded, exact], one)
        costs.append(with_load.metrics.rms_tail.max() - without_load.metrics.rms_tail.max())
    assert costs[0] < 0.1 * costs[1]


@pytest.mark.parametrize("law", OBSERVED, ids=NAMES)
def test_a_torque_that_was_cut_is_no_disturbance(law):
    law = dataclasses.replace(law, **({"ki": 0.0} if hasattr(law, "ki") else {}))
    arm = ROD.with_limits(effort=1.0)
    experiment = fp.Experiment(arm, Hold(1.0), q0=0.0, duration=1.0)
    observed, alone = (fp.simulate(experiment, one) for one in (law, without(law)))
    assert (np.abs(alone.torque[:500]) == 1.0).all()
    assert observed.q == pytest.approx(alone.q, abs=1e-11)


@pytest.mark.parametrize("law", OBSERVED, ids=NAMES)
def test_a_population_has_the_bits_of_its_members(law):
    # One of them has no observer, one is thrown out by a delay that it cannot bear.
    laws = [law, dataclasses.replace(law, observer=0.0), dataclasses.replace(law, observer=900.0)]
    sensors = [fp.Sensors(velocity_noise=0.01), None, fp.Sensors(delay=40)]
    heavy = fp.Plant(arm=ARM.with_payload(0.5))
    experiments = [following(ARM, 2.0, plant=heavy, sensors=s) for s in sensors]
    runs = fp.simulate(experiments, laws)
    assert not runs[2].outcome.completed
    for run, experiment, one in zip(runs, experiments, laws, strict=True):
        assert (run.torque == fp.simulate(experiment, one).torque).all()


def test_a_run_file_holds_them(tmp_path):
    for law in OBSERVED:
        run = fp.simulate(following(ARM, 0.1), law)
        back = fp.Run.load(run.save(tmp_path / "run.npz"))
        assert back.controller.observer == OMEGA
        assert (fp.simulate(back.experiment, back.controller).torque == run.torque).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: fp.ComputedTorque(ki=-1.0), "ki: expected a number >= 0, got -1"),
        (lambda: fp.PdGravity(1.0, 1.0, observer=-1.0), "observer: expected a number >= 0, got -1"),
        (
            lambda: fp.ComputedTorque(observer=3e3).start(ARM, step=1e-3),
            r"observer: expected at most 1/step \(1000 rad/s\), got 3000 rad/s",
        ),
    ],
)
def test_bad_arguments_give_one_clear_line(make, message):
    with pytest.raises(ArgumentError, match=message):
        make()
