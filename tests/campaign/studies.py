"""Small campaigns for tests: half a second of the paper's experiment on other plants."""

import dataclasses

import fpid_pin as fp
from fpid_pin.campaign import Choices, LogUniform, Normal, Scenarios, Study, Uniform

UNCERTAIN = {
    "mass": Uniform(low=0.8, high=1.2),
    "inertia": Uniform(low=0.5, high=1.5, shared=True),
    "payload": Uniform(low=0.0, high=1.0),
    "viscous_friction": Normal(mean=0.1, std=0.1),
    "disturbance_amplitude": LogUniform(low=0.1, high=2.0, shared=True),
    "position_noise": Uniform(low=0.0, high=1e-3),
    "delay": Choices(values=[0, 1, 2]),
    "q0": Uniform(low=-0.1, high=[0.2, 0.4]),
}


def study(duration=0.5, step=5e-3, seed=3, uncertain=UNCERTAIN, dynamics="compiled", **scenarios):
    experiment = fp.paper_experiment(duration=duration, step=step)
    experiment = dataclasses.replace(experiment, dynamics=dynamics)
    laws = {"fractional": fp.paper_controller(), "integer": fp.paper_controller("integer")}
    return Study(experiment, laws, Scenarios(uncertain, seed=seed, **scenarios), "a test")


def bits(data):
    metrics = b"".join(values.tobytes() for values in data.metrics.values())
    return data.samples.tobytes() + metrics, data.outcome.tolist(), data.cause.tolist()
