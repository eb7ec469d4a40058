"""What `baselines.py` asks of every law: arms, model errors, motions, conditions, and the cost.

Every run starts on its reference, so that what is measured is following, not the catching up of a
start at rest. Laws are trained on arms that are not as their model says, and tried on others.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np
from common import arm_of, on_reference
from scipy.stats import qmc

import fpid_pin as fp
from fpid_pin.costs import Cost, Metrics
from fpid_pin.disturbances import Cosine
from fpid_pin.references import Reference, Sinusoid, Waypoints

NOISE = fp.Sensors(position_noise=2e-5, velocity_noise=0.01)  # [rad], [rad/s]
LOUD = fp.Sensors(position_noise=1e-4, velocity_noise=0.05, position_resolution=1e-4)
#: Training plants a seed, held-out plants in all, and how many of them each harder condition takes.
TRAINING, HELD_OUT, HARDER = 3, 12, 6
#: What a model error may be: relative errors of masses and inertias, shifts of centres of mass [m].
MASS, COM = 0.2, 0.01
PUSH_FREQUENCY = 5.0 * np.pi  # [rad/s]
STEP = 2e-3  # [s]
PERIOD = 2.0 * np.pi / 3.0  # of the motion that laws are trained on [s]


@dataclass(frozen=True)
class TailCost(Cost):
    """RMS error over all joints, last half of the run, where the torque keeps quiet.

    A law can always buy accuracy by gains that turn noise into torque. So what varies more than is
    allowed multiplies the cost, by the square of the excess: that never pays.
    """

    quiet: float  # total variation allowed [N m]

    def of(self, metrics: Metrics) -> float:
        """See `Cost.of`."""
        rms = float(np.sqrt(np.mean(metrics.rms_tail**2)))
        return rms * max(1.0, float(metrics.total_variation.sum()) / self.quiet) ** 2


@dataclass(frozen=True)
class Job:
    """An arm and what it is asked to do."""

    name: str
    arm: fp.Arm
    scale: np.ndarray  # the joints' proportions, (n,)
    payload: float  # largest that is trained on [kg]
    push: float  # largest amplitude of a torque from outside [N m]
    quiet: float  # torque variation allowed [N m/s]
    w2: float  # weight of energy in cost (33)

    @property
    def cost(self) -> TailCost:
        """What is tuned for."""
        return TailCost(self.quiet * 2.0 * PERIOD)

    def around_home(self, frequency: float, spread: float, turn: float) -> Sinusoid:
        """Return a sinusoid of 0.3 rad; joints differ in frequency by up to `spread`."""
        n = self.arm.n
        phase = np.linspace(0.0, np.pi, n, endpoint=False) + turn * np.arange(n)
        rates = frequency * (1.0 + spread * np.linspace(-1.0, 1.0, n))
        return Sinusoid(amplitude=0.3, frequency=rates, phase=phase, offset=self.arm.home)

    def experiment(self, reference: Reference, duration: float, seed: int) -> fp.Experiment:
        """Return a run of the exact arm that starts on its reference.

        By the compiled dynamics: twice as fast as Pinocchio's here, and the same within rounding.
        """
        return fp.Experiment(
            self.arm, reference, **on_reference(reference), sensors=NOISE, step=STEP,
            duration=duration, seed=seed, dynamics="compiled",
        )  # fmt: skip

    def motions(self) -> dict[str, tuple[Reference, float]]:
        """Return the motions and how long they last [s]; the first is trained on."""
        n, rng = self.arm.n, np.random.default_rng(5)
        stops = self.arm.home + rng.uniform(-0.4, 0.4, (5, n))
        stops[0] = self.arm.home
        return {
            "trained": (self.around_home(3.0, 0.0, 0.0), 2.0 * PERIOD),
            "slower, out of step": (self.around_home(2.0, 0.3, 0.7), 6.0),
            "waypoints": (Waypoints(np.arange(5.0), stops, method="quintic"), 4.0),
        }

    def plants(self, count: int, seed: int) -> list[fp.Experiment]:
        """Return runs on `count` arms that the model does not describe, a Latin hypercube.

        Payload, error of the masses, viscous and dry friction, a torque from outside, and whether
        the measurements are a sample late.
        """
        rows = qmc.LatinHypercube(6, rng=np.random.default_rng(seed)).random(count)
        base = self.experiment(*self.motions()["trained"], seed=seed)
        return [self._wrong(base, row, 1000 * seed + k) for k, row in enumerate(rows)]

    def _wrong(self, base: fp.Experiment, row: np.ndarray, seed: int) -> fp.Experiment:
        payload, mass, viscous, dry, push, late = row
        arm = self.arm.perturbed(np.random.default_rng(seed), mass=MASS * mass, com=COM * mass)
        size = self.scale
        plant = fp.Plant(
            arm=arm.with_payload(self.payload * payload),
            viscous_friction=arm.viscous_friction + viscous * size,
            dry_friction=arm.dry_friction + 0.5 * dry * size,
            disturbance=Cosine(self.push * push * size / size.max(), frequency=PUSH_FREQUENCY),
        )
        sensors = dataclasses.replace(NOISE, delay=int(2.0 * late))
        return dataclasses.replace(base, plant=plant, sensors=sensors, seed=seed)

    def training(self, seed: int) -> list[fp.Experiment]:
        """Return what seed `seed` is trained on."""
        return self.plants(TRAINING, 100 + seed)

    def conditions(self) -> dict[str, list[fp.Experiment]]:
        """Return what every law is tried under: arms that none was trained on."""
        held_out = self.plants(HELD_OUT, 7)
        exact = [self.experiment(*self.motions()["trained"], seed=s) for s in range(HARDER)]
        table = {"held-out arms": held_out}
        for name, (reference, duration) in list(self.motions().items())[1:]:
            motion = {"reference": reference, "duration": duration, **on_reference(reference)}
            table[name] = [dataclasses.replace(e, **motion) for e in held_out]
        few, late = held_out[:HARDER], dataclasses.replace(NOISE, delay=2)
        size = self.scale
        heavy = fp.Plant(arm=self.arm.with_payload(1.5 * self.payload))
        stiff = {"viscous_friction": 2.0 * size, "dry_friction": size}
        push = Cosine(2.0 * self.push * size / size.max(), frequency=PUSH_FREQUENCY)
        return table | {
            "exact model": exact,
            "payload x 1.5": [dataclasses.replace(e, plant=heavy) for e in exact],
            "friction x 2": [_with(e, **stiff) for e in few],
            "push x 2": [_with(e, disturbance=push) for e in few],
            "noise x 5": [dataclasses.replace(e, sensors=LOUD) for e in few],
            "4 ms late": [dataclasses.replace(e, sensors=late) for e in few],
        }


def _with(experiment: fp.Experiment, **changes: object) -> fp.Experiment:
    plant = dataclasses.replace(experiment.plant, **changes)  # type: ignore[type-var]
    return dataclasses.replace(experiment, plant=plant)


def jobs() -> dict[str, Job]:
    """Return the arms with their work."""
    numbers = {
        "two_link": (0.5, 3.0, 1000.0, 1e-4), "ur5": (3.0, 10.0, 2000.0, 1e-6),
        "panda": (2.0, 5.0, 2000.0, 1e-6),
    }  # fmt: skip
    arms = {name: arm_of(name) for name in numbers}
    return {
        name: Job(name, arms[name], np.asarray(fp.suggest_gains(arms[name]).scale), *rest)
        for name, rest in numbers.items()
    }


def excess(experiment: fp.Experiment, run: fp.Run, w2: float) -> float:
    """Return cost (33) without what following exactly would take of the same plant anyway.

    ``int e^2 + w2 |u - u_d|^2 dt`` with u_d the torque that keeps the true arm, its friction and
    the push included, on the reference: gravity's share, which no law can save, is not counted.
    """
    plant = fp.Plant() if experiment.plant is None else experiment.plant
    true = plant.resolve(experiment.arm)
    q, v, a = experiment.motion(run.t)
    needed = np.array([true.arm.inverse_dynamics(*row) for row in zip(q, v, a, strict=True)])
    needed += true.viscous_friction * v + true.dry_friction * np.sign(v)
    if true.disturbance is not None:
        needed -= true.disturbance.sample(run.t)
    waste = np.sum((run.torque - needed)[:-1] ** 2) * run.step
    return float(run.metrics.ise.sum() + w2 * waste)
