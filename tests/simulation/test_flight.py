"""Compiled dynamics and flights: Pinocchio's motion, and the bits of tick by tick."""

import dataclasses

import numpy as np
import pytest
from fpid_pin.simulation.recorders import BLOCK_ROWS

import fpid_pin as fp
from fpid_pin.arms import CompiledFleet
from fpid_pin.arms.catalogue import names
from fpid_pin.disturbances import Cosine, Pulse
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references import Hold, Sinusoid
from fpid_pin.simulation import Simulator


def arms():
    yield pytest.param(fp.Arm.two_link(), id="two_link")
    yield pytest.param(fp.Arm.planar(np.full(50, 0.1), np.full(50, 0.2)), id="planar50")
    for name in names():
        yield pytest.param(fp.Arm.from_example(name), id=name)


@pytest.mark.parametrize("arm", list(arms()))
def test_every_arm_accelerates_as_pinocchio_has_it(arm):
    rng = np.random.default_rng(0)
    heavy = arm.perturbed(rng, mass=0.3, com=0.02, inertia=0.2).with_payload(1.0, (0.1, 0.0, 0.05))
    tilted = arm.with_gravity((3.0, -2.0, 8.0)).with_armature(rng.uniform(0.0, 0.2, arm.n))
    plants = [arm, heavy, tilted, heavy]
    fleet = CompiledFleet(plants, np.zeros((4, arm.n)))
    assert len(fleet.bodies) == 3
    q, v, tau = rng.normal(size=(3, 4, arm.n))
    a = np.zeros_like(q)
    fleet.forward_dynamics(q, v, tau, a)
    for k, plant in enumerate(plants):
        exact = plant.forward_dynamics(q[k], v[k], tau[k])
        spread = np.linalg.cond(plant.mass_matrix(q[k]))
        assert np.abs(a[k] - exact).max() < (1e-11 + 1e-15 * spread) * np.abs(exact).max()


def compiled(**changes):
    base = dataclasses.replace(fp.paper_experiment(duration=1.0), dynamics="compiled")
    return dataclasses.replace(base, **changes)


ARM = fp.Arm.two_link()
EXPERIMENTS = {
    "paper": compiled(),
    "heavy": compiled(plant=fp.Plant(arm=ARM.with_payload(0.5))),
    "viscous": compiled(plant=fp.Plant(viscous_friction=(0.3, 0.2), disturbance=Pulse(2.0, 0.2))),
    "dry": compiled(plant=fp.Plant(dry_friction=(4.0, 1.5), viscous_friction=0.1)),
    "rest": compiled(reference=Hold(0.3), q0=0.3, v0=0.0, plant=fp.Plant(dry_friction=50.0)),
    "limits": compiled(plant=fp.Plant(effort_limit=(22.0, 9.0), disturbance=Cosine((0.4, 0.6)))),
    "sensors": compiled(
        sensors=fp.Sensors(position_resolution=1e-3, velocity_noise=0.05, delay=2), seed=4
    ),
    "derived": compiled(sensors=fp.Sensors(velocity="differentiated", position_noise=1e-4)),
}
LAWS = [
    fp.paper_controller(supervised=False),
    dataclasses.replace(fp.paper_controller("integer", supervised=False), order_learning_rate=0.1),
    dataclasses.replace(
        fp.paper_controller(supervised=False),
        safeguards=fp.Safeguards(maximum=40.0, sigma=0.1, dead_zone=0.01),
    ),
]
SIGNALS = ("q", "v", "torque", "kp", "ki", "kd", "s", "u_fpid", "lyapunov")


@pytest.mark.parametrize("name", EXPERIMENTS)
@pytest.mark.parametrize("law", LAWS, ids=["paper", "orders", "guarded"])
def test_a_flight_has_the_bits_of_tick_by_tick_and_the_motion_of_pinocchio(name, law):
    experiment = EXPERIMENTS[name]
    run = fp.simulate(experiment, law)
    simulator = Simulator([experiment], [law], keep=None)
    assert simulator._flight is not None
    simulator._flight = None
    for first in range(0, 1001, BLOCK_ROWS):
        simulator.tick(min(BLOCK_ROWS, 1001 - first))
        block = simulator.block()
        rows = slice(first, first + len(block.t))
        for signal in SIGNALS:
            part = block.signals[signal] if signal in block.signals else getattr(block, signal)
            assert np.array_equal(part[:, 0], getattr(run, signal)[rows]), signal
    pinocchio = fp.simulate(dataclasses.replace(experiment, dynamics="pinocchio"), law)
    assert np.abs(run.q - pinocchio.q).max() < 1e-9


def test_flights_in_company_have_the_bits_of_each_alone():
    experiments, laws = list(EXPERIMENTS.values()), [LAWS[0]] * len(EXPERIMENTS)
    for experiment, run in zip(experiments, fp.simulate(experiments, laws), strict=True):
        assert np.array_equal(run.q, fp.simulate(experiment, LAWS[0]).q)


def test_a_flight_ends_where_tick_by_tick_does():
    bad = dataclasses.replace(LAWS[0], kd=5000.0)
    slow = dataclasses.replace(LAWS[0], kp=2000.0, kd=0.0)
    experiment = compiled(runaway_speed=20.0)
    for law in (bad, slow):
        runs = fp.simulate(experiment, [law, LAWS[0]])
        simulator = Simulator([experiment], [law])
        simulator._flight = None
        while simulator.alive and simulator.row < 1001:
            simulator.tick()
        assert runs[0].outcome == simulator.ends[0]
        assert not runs[0].outcome.completed
        assert runs[1].outcome.completed
        assert np.array_equal(runs[1].q, fp.simulate(experiment, LAWS[0]).q)


def test_nan_from_outside_ends_a_flight_where_it_came_in():
    class Broken:
        def sample(self, t):
            d = np.zeros((len(t), 2))
            d[t > 0.3] = np.nan
            return d

    run = fp.simulate(compiled(plant=fp.Plant(disturbance=Broken())), LAWS[0])
    assert run.outcome.cause == "speed is not finite"
    assert run.outcome.time == pytest.approx(0.302, abs=1e-9)


def test_laws_that_are_no_kernels_use_the_compiled_dynamics_too():
    experiment = compiled()
    plain = dataclasses.replace(experiment, dynamics="pinocchio")
    for law in (fp.ComputedTorque(), fp.paper_controller()):
        runs = [fp.simulate(e, law) for e in (experiment, plain)]
        assert np.abs(runs[0].q - runs[1].q).max() < 1e-12
    smooth = [
        fp.simulate(dataclasses.replace(e, integrator="rk4"), LAWS[0]) for e in (experiment, plain)
    ]
    assert np.abs(smooth[0].q - smooth[1].q).max() < 1e-12


def test_costs_of_flights_are_those_of_their_record():
    experiment = compiled()
    costs = fp.evaluate(experiment, LAWS[:1])
    assert costs[0] == fp.costs.QuadraticCost().of(fp.simulate(experiment, LAWS[0]).metrics)


def test_a_wrong_word_is_named():
    with pytest.raises(ArgumentError, match=r"dynamics: .* \(did you mean compiled\?\)"):
        compiled(dynamics="compile")


def test_a_moving_reference_and_a_tree_of_sensors_on_seven_joints():
    arm = fp.Arm.from_example("panda")
    experiment = fp.Experiment(
        arm, Sinusoid(0.3, 1.0, offset=arm.home), duration=0.5, dynamics="compiled",
        sensors=fp.Sensors(velocity_noise=0.01), plant=fp.Plant(arm=arm.with_payload(1.0)),
    )  # fmt: skip
    law = fp.suggest_gains(arm)
    run = fp.simulate(experiment, law)
    other = fp.simulate(dataclasses.replace(experiment, dynamics="pinocchio"), law)
    assert np.abs(run.q - other.q).max() < 1e-10
