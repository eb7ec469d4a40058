"""Feedforward and disturbance observer of the FPID: what they cancel, how exactly, and when not."""

import dataclasses
import functools

import numpy as np
import pytest

import fpid_pin as fp
from fpid_pin.cli.configuration import parse
from fpid_pin.disturbances import Cosine, Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold, Sinusoid

STEP, OMEGA, LOAD = 1e-3, 60.0, 0.7
ROD = fp.Arm.planar([1.0], [2.0], gravity=0.0)  # M = 2 kg m^2, nothing else
LAW = fp.AdaptiveFpid(kp=200.0, ki=0.0, kd=40.0, learning_rate=0.0)


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


# ------------------------------------------------------------------ feedforward


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


@pytest.mark.parametrize("integrator", ["semi_implicit_euler", "rk4"])
def test_on_a_whole_arm_the_error_halves_with_the_step(integrator):
    arm = fp.Arm.two_link().with_friction(viscous=0.5)
    law = dataclasses.replace(LAW, scale="inertia")
    errors = []
    for step in (2e-3, 1e-3, 5e-4):
        experiment = following(arm, 4.0, step=step, integrator=integrator)
        errors.append(tail(fp.simulate(experiment, with_model(law))))
    assert errors[1] < 0.01 * tail(fp.simulate(following(arm, 4.0), law))
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx([2.0, 2.0], rel=0.02)


def test_at_rest_the_arm_is_held_without_any_error():
    arm = fp.Arm.from_example("ur5")
    law = dataclasses.replace(with_model(LAW, OMEGA), scale="inertia")
    run = fp.simulate(fp.Experiment(arm, Hold(arm.home), duration=1.0), law)
    assert np.abs(run.error).max() < 1e-13


def test_the_model_is_the_nominal_one_whatever_the_plant():
    arm = fp.Arm.two_link().with_friction(viscous=(0.4, 0.2), dry=0.3)
    plant = fp.Plant(arm=arm.with_payload(0.5), viscous_friction=3.0)
    run = fp.simulate(following(arm, 0.2, plant=plant), with_model(LAW))
    for k in (0, 50, 200):
        q, v, a = (x[0] for x in following(arm, 0.2).reference.sample(run.t[k : k + 1]))
        expected = arm.inverse_dynamics(q, v, a) + (0.4, 0.2) * v
        assert run.u_model[k] == pytest.approx(expected, rel=1e-12)
    assert run.torque == pytest.approx(run.u_fpid + run.u_model, rel=1e-12)


# ------------------------------------------------------------------ observer


def shown(n):
    """Return how much of a constant torque the observer has found after 0, 1 .. n - 1 samples."""
    p, k = np.exp(-OMEGA * STEP), np.arange(n)
    return 1.0 - p**k * (1.0 + (1.0 - p) * k)  # both poles p, from rest


def test_a_constant_torque_is_found_by_its_closed_form_and_cancelled():
    plant = fp.Plant(disturbance=Cosine(LOAD, frequency=0.0))
    experiment = fp.Experiment(ROD, Hold(0.0), plant=plant, duration=1.5)
    law = dataclasses.replace(LAW, observer=OMEGA)
    run = fp.simulate(experiment, law)
    assert np.abs(run.u_model[:, 0] + LOAD * shown(len(run.t))).max() < 1e-11
    assert np.abs(run.error[-1]).max() < 1e-8
    alone = fp.simulate(dataclasses.replace(experiment, duration=6.0), LAW)
    assert alone.error[-1, 0] == pytest.approx(-LOAD / 200.0, rel=1e-6)


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


def test_a_reference_that_jumps_is_no_disturbance():
    class Jump:
        def sample(self, t):
            there = np.where(t < 0.2, 0.0, 0.5)[:, np.newaxis]
            return there, 0.0 * there, 0.0 * there

    arm = fp.Arm.two_link()
    experiment = fp.Experiment(arm, Jump(), duration=1.0)
    law = dataclasses.replace(LAW, observer=300.0)
    run, alone = fp.simulate(experiment, [law, LAW])
    assert np.abs(run.torque).max() > 50.0
    assert np.abs(run.u_model).max() < 1e-9
    assert run.q == pytest.approx(alone.q, abs=1e-10)


# ------------------------------------------------------------------ effort limits


def test_a_torque_that_was_cut_is_no_disturbance_and_winds_nothing_up():
    arm = ROD.with_limits(effort=1.0)
    law = dataclasses.replace(with_model(LAW, 200.0), ki=50.0, learning_rate=1.0)
    run = fp.simulate(fp.Experiment(arm, Hold(1.0), q0=0.0, duration=0.5), law)
    cut = np.abs(run.torque[:, 0]) == 1.0
    assert cut[:100].all()
    assert np.abs(run.u_model).max() < 1e-10
    assert (run.kp[cut] == 200.0).all()
    # S = -(e' + k1 e + k0 int e) with k0 = 1: int e stands still.
    integral = -run.s - (run.v_ref - run.v) - 2.0 * run.error
    assert np.abs(integral[:100]).max() < 1e-13


def test_it_is_the_whole_torque_that_counts_as_cut():
    # The FPID alone asks for 20 N m, well within the limit; gravity's feedforward for 19.6 more.
    arm = fp.Arm.planar([1.0], [2.0], gravity=9.8).with_limits(effort=30.0)
    law = dataclasses.replace(LAW, ki=50.0, learning_rate=1.0)
    seen = {}
    for name, one in {"with": with_model(law), "without": law}.items():
        loop = one.start(arm, step=STEP)
        for _ in range(100):
            torque = loop.torque([-0.1], [0.0], [0.0], [0.0])
        seen[name] = torque, loop.signals()
    torque, signals = seen["with"]
    assert torque == pytest.approx([30.0])
    assert signals["u_model"] == pytest.approx([19.6])
    assert signals["s"] == pytest.approx([-0.2], rel=1e-9)
    assert signals["kp"] == 200.0
    assert seen["without"][1]["s"] < -0.209
    assert seen["without"][1]["kp"] > 200.0


# ------------------------------------------------------------------ what it is worth


@functools.cache
def errors(name):
    """Return tail errors and variations with exact law and its model, by plant and law."""
    arm = fp.Arm.from_example(name)
    law = fp.suggest_gains(arm)
    noise = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)
    base = following(arm, np.pi, sensors=noise)
    heavy = fp.Plant(arm=arm.with_payload(3.0))
    size = np.asarray(law.scale)
    rough = fp.Plant(viscous_friction=size, dry_friction=0.5 * size)
    loud = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, delay=2)
    experiments = {
        "payload": dataclasses.replace(base, plant=heavy),
        "friction": dataclasses.replace(base, plant=rough),
        "payload, noise, delay": dataclasses.replace(base, plant=heavy, sensors=loud),
    }
    found = {}
    for key, one in (("alone", law), ("model", with_model(law, 100.0))):
        for plant, run in zip(
            experiments, fp.simulate(list(experiments.values()), one), strict=True
        ):
            found[plant, key] = tail(run), run.metrics.total_variation.sum()
    return found


@pytest.mark.parametrize("name", ["ur5", "panda"])
@pytest.mark.parametrize(
    ("plant", "part"), [("payload", 0.1), ("friction", 0.1), ("payload, noise, delay", 0.15)]
)
def test_what_the_model_lacks_costs_a_small_part_of_the_error(name, plant, part):
    found = errors(name)
    assert found[plant, "model"][0] < part * found[plant, "alone"][0]


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_the_price_is_some_variation_of_the_torque(name):
    found = errors(name)
    assert found["payload", "model"][1] < 1.4 * found["payload", "alone"][1]


# ------------------------------------------------------------------ off, batches, files, faults


def test_it_is_off_by_default_to_the_last_bit():
    experiment = fp.paper_experiment(duration=1.0)
    off = dataclasses.replace(fp.paper_controller(), feedforward=False, observer=0.0)
    run, other = fp.simulate(experiment, [fp.paper_controller(), off])
    assert (run.torque == other.torque).all()
    assert "u_model" not in run.signals


def test_a_population_has_the_bits_of_its_members():
    arm = fp.Arm.two_link()
    laws = [
        with_model(dataclasses.replace(LAW, kp=kp, learning_rate=2.0), omega)
        for kp, omega in ((50.0, 0.0), (60.0, 20.0), (70.0, 90.0), (80.0, 0.0), (90.0, 300.0))
    ] + [LAW, dataclasses.replace(LAW, observer=40.0)]
    sensors = fp.Sensors(velocity_noise=0.01)
    heavy = fp.Plant(arm=arm.with_payload(0.5))
    experiment = following(arm, 0.5, plant=heavy, sensors=sensors)
    for run, law in zip(fp.simulate(experiment, laws), laws, strict=True):
        alone = fp.simulate(experiment, law)
        assert (run.torque == alone.torque).all()
        assert run.signals.keys() == alone.signals.keys()
        assert all((run.signals[name] == alone.signals[name]).all() for name in run.signals)


def test_a_run_file_holds_it(tmp_path):
    law = with_model(LAW, OMEGA)
    run = fp.simulate(following(fp.Arm.two_link(), 0.1), law)
    back = fp.Run.load(run.save(tmp_path / "run.npz"))
    assert (back.u_model == run.u_model).all()
    assert back.controller.feedforward is True
    assert back.controller.observer == OMEGA
    assert (fp.simulate(back.experiment, back.controller).torque == run.torque).all()


def test_a_configuration_may_ask_for_it(tmp_path):
    text = """
    format = 1
    arm = {kind = "two_link"}
    reference = {kind = "sinusoid", amplitude = [0.3, 0.3]}
    simulation = {duration = 0.1}
    [[controller]]
    kind = "adaptive_fpid"
    name = "model"
    kp = 200
    ki = 0
    kd = 40
    feedforward = true
    observer = 60
    """
    law = parse(text, "own.toml", tmp_path).controllers["model"]
    assert (law.feedforward, law.observer) == (True, 60.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"observer": -1.0}, "observer: expected a number >= 0, got -1"),
        ({"observer": np.nan}, "observer: expected a number"),
        ({"feedforward": 1}, "feedforward: expected true or false, got"),
    ],
)
def test_bad_arguments_give_one_clear_line(changes, message):
    with pytest.raises(ArgumentError, match=message):
        dataclasses.replace(LAW, **changes)


def test_an_observer_faster_than_the_sampling_is_refused():
    law = dataclasses.replace(LAW, observer=2500.0)
    message = r"observer: expected at most 1/step \(1000 rad/s\), got 2500 rad/s"
    with pytest.raises(ArgumentError, match=message):
        law.start(ROD, step=1e-3)
    law.start(ROD, step=4e-4)
