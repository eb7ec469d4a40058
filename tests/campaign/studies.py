"""Small campaigns for tests: run, or by formula; disturbances that fail, or kill their process."""

import dataclasses
import os
import time
from pathlib import Path

import numpy as np

import fpid_pin as fp
from fpid_pin.campaign import CampaignData, Choices, LogUniform, Normal, Scenarios, Study, Uniform
from fpid_pin.campaign.data import METRICS
from fpid_pin.disturbances import Cosine

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
    """Return half a second of the paper's experiment on other plants."""
    experiment = fp.paper_experiment(duration=duration, step=step)
    experiment = dataclasses.replace(experiment, dynamics=dynamics)
    laws = {"fractional": fp.paper_controller(), "integer": fp.paper_controller("integer")}
    return Study(experiment, laws, Scenarios(uncertain, seed=seed, **scenarios), "a test")


def pushed(disturbance):
    """Return a study whose disturbance is of another kind, and only its amplitude uncertain."""
    made = study(uncertain={"disturbance_amplitude": Uniform(low=0.1, high=1.1, shared=True)})
    plant = fp.Plant(disturbance=disturbance)
    return dataclasses.replace(made, experiment=dataclasses.replace(made.experiment, plant=plant))


def bits(data):
    metrics = b"".join(values.tobytes() for values in data.metrics.values())
    return data.samples.tobytes() + metrics, data.outcome.tolist(), data.cause.tolist()


@dataclasses.dataclass(frozen=True, eq=False)
class Deadly(Cosine):
    """Kills its process where its amplitude is beyond DEADLY; a note in DEATHS for each death."""

    def sample(self, t):
        if np.max(self.amplitude) > float(os.environ.get("DEADLY", "inf")):
            Path(os.environ["DEATHS"], f"{time.monotonic_ns()}-{os.getpid()}").touch()
            os._exit(9)
        return super().sample(t)


@dataclasses.dataclass(frozen=True, eq=False)
class Faulty(Cosine):
    """Fails where its amplitude is beyond 1."""

    def sample(self, t):
        if np.max(self.amplitude) > 1.0:
            raise ZeroDivisionError("a fault of its own")
        return super().sample(t)


#: What decides first, at a scale of 1.
SCALED = ("rms_tail", *(name for name in METRICS if name != "rms_tail"))


def campaign(errors, samples=None, *, names=None, outcome=None, labels=None, title="made", seed=0):
    """Return a campaign with these tail errors, (runs, controllers); NaN: diverged."""
    errors = np.asarray(errors, dtype=float)
    runs, columns = errors.shape
    samples = np.zeros((runs, 0)) if samples is None else np.asarray(samples, dtype=float)
    labels = labels or tuple(f"p{k}" for k in range(samples.shape[1]))
    if outcome is None:
        outcome = np.where(np.isnan(errors), "diverged", "completed")
    return CampaignData(
        title, seed, names or tuple("ABCDEFGH"[:columns]), labels, ("kg",) * len(labels), samples,
        outcome, np.where(np.isnan(errors), "speed 2e3 rad/s", ""),
        {name: errors * scale for scale, name in enumerate(SCALED, start=1)},
    )  # fmt: skip


def arms(runs, names, seed=0):
    """Return a campaign that looks like one of arms: heavy payloads are lost."""
    rng = np.random.default_rng(seed)
    x = rng.random((runs, 3)) * (2.0, 3.0, 0.005)
    scale = np.linspace(1.0, 3.0, len(names))
    errors = 0.01 * scale * np.exp(rng.normal(0.0, 0.3, (runs, len(names)))) * (1.0 + x[:, :1])
    errors[x[:, :1] + rng.normal(0.0, 0.1, errors.shape) > 2.1 - 0.2 * scale] = np.nan
    return campaign(
        errors, x, names=names, labels=("payload", "viscous_friction.0", "delay"), seed=seed
    )
