"""What is simulated: one robot, one job, one clock."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.references import Motion, Reference
from fpid_pin.simulation.plant import Plant, ResolvedPlant
from fpid_pin.simulation.sensors import Sensors

INTEGRATORS = ("semi_implicit_euler", "rk4")
DYNAMICS = ("pinocchio", "compiled")


@described("experiment")
@dataclass(frozen=True, eq=False)
class Experiment:
    """One robot and what it is asked to do; a difference between runs is another Experiment.

    Parameters
    ----------
    arm
        The nominal arm: what the controller believes in.
    reference
        The trajectory to follow.
    q0, v0
        State at t = 0 [rad], [rad/s], scalar or (n,); q0 None: the reference's start; v0 None: at
        rest.
    plant
        The true robot; None: the nominal arm, undisturbed.
    sensors
        None: angles and rates are measured exactly.
    step
        Sampling period and integration step [s], from 1 ns to 10 s.
    duration
        [s]; a run has ``round(duration/step) + 1`` rows.
    integrator
        ``"semi_implicit_euler"`` or ``"rk4"``; the torque is held over the step in both.
    dynamics
        ``"pinocchio"``: Pinocchio's own functions, one robot and one call at a time; or
        ``"compiled"``: the package's rigid-body kernels, whole stretches of a run in one call.
        None: Pinocchio's where runs are recorded (`simulate`), compiled where thousands are
        compared (`evaluate`, `tune`, campaigns). The two agree within rounding, not to the bit.
    seed
        Of the sensors' noise.
    runaway_speed
        A joint faster than this [rad/s] ends the run.
    """

    arm: Arm
    reference: Reference
    q0: ArrayLike | None = None
    v0: ArrayLike | None = None
    plant: Plant | None = None
    sensors: Sensors | None = None
    step: float = 1e-3
    duration: float = 20.0
    integrator: str = "semi_implicit_euler"
    dynamics: str | None = None
    seed: int = 0
    runaway_speed: float = 1e3

    def __post_init__(self) -> None:
        checks.instance("arm", self.arm, Arm, "an Arm")
        checks.instance("reference", self.reference, Reference, "an object with sample(t)")
        checks.number("step", self.step, above=0.0)
        low, high = checks.STEPS
        object.__setattr__(self, "step", checks.number("step", self.step, low=low, high=high))
        object.__setattr__(self, "duration", checks.number("duration", self.duration))
        checks.sample_count(self.duration, self.step)
        if self.plant is not None:
            checks.instance("plant", self.plant, Plant, "a Plant or None")
        if self.sensors is not None:
            checks.instance("sensors", self.sensors, Sensors, "Sensors or None")
        n = self.arm.n
        start = self.motion(np.zeros(1))[0][0]
        if self.q0 is None:
            object.__setattr__(self, "q0", checks.read_only(start))
        else:
            object.__setattr__(self, "q0", checks.per_joint("q0", self.q0, n))
        speed = checks.number("runaway_speed", self.runaway_speed, above=0.0)
        object.__setattr__(self, "runaway_speed", speed)
        v0 = checks.per_joint("v0", 0.0 if self.v0 is None else self.v0, n)
        if (np.abs(v0) > speed).any():
            raise checks.ArgumentError("v0", f"at most runaway_speed ({speed:g} rad/s)", v0)
        object.__setattr__(self, "v0", v0)
        checks.choice("integrator", self.integrator, INTEGRATORS)
        if self.dynamics is not None:
            checks.choice("dynamics", self.dynamics, DYNAMICS)
        object.__setattr__(self, "seed", checks.integer("seed", self.seed, low=0))
        disturbance = plant_of(self).disturbance
        if disturbance is not None:
            shape = np.shape(disturbance.sample(np.zeros(1)))
            if shape not in ((1, n), (1, 1)):
                raise checks.ArgumentError(
                    "plant.disturbance", f"(K, {n}) at K times (the arm has {n} joints)", f"{shape}"
                )

    @property
    def rows(self) -> int:
        """Number of samples of a run, both ends included."""
        return checks.sample_count(self.duration, self.step)

    @property
    def torque_limit(self) -> FloatArray:
        """What neither the law nor the drives go beyond [N m], (n,)."""
        limit: FloatArray = np.minimum(self.arm.effort_limit, plant_of(self).effort_limit)
        return limit

    def with_dynamics(self, dynamics: str) -> Experiment:
        """Return the experiment with its dynamics written out: these where it does not say."""
        return self if self.dynamics is not None else replace(self, dynamics=dynamics)

    def motion(self, t: FloatArray) -> Motion:
        """Sample the reference at `t`, (K,), as three (K, n) arrays, checked.

        Raises
        ------
        ArgumentError
            The reference has another number of joints, or is not finite.
        """
        n, out = self.arm.n, []
        for name, array in zip(("q", "v", "a"), self.reference.sample(t), strict=True):
            array = np.asarray(array, dtype=np.float64)
            if array.shape not in ((len(t), n), (len(t), 1)):
                raise checks.ArgumentError(
                    f"reference {name}", f"shape ({len(t)}, {n})", f"shape {array.shape}"
                )
            if not np.isfinite(array).all():
                at = t[int(np.argwhere(~np.isfinite(array))[0, 0])]
                raise checks.ArgumentError(
                    f"reference {name}", "finite values", f"NaN or inf at t = {at:g} s"
                )
            out.append(np.broadcast_to(array, (len(t), n)))
        return out[0], out[1], out[2]


def plant_of(experiment: Experiment) -> ResolvedPlant:
    """Return the plant of an experiment; None means the nominal arm, undisturbed."""
    plant = Plant() if experiment.plant is None else experiment.plant
    return plant.resolve(experiment.arm)
