"""One robot under control, a tick at a time: what the live view runs in real time."""

from __future__ import annotations

import numpy as np

from fpid_pin import checks
from fpid_pin.control.controller import Controller
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.integrators import integrator
from fpid_pin.simulation.plant import plant_of
from fpid_pin.simulation.sensors import SensorState

_BLOCK = 64


class LiveRobot:
    """An experiment that goes on tick by tick: the same steps as `fpid_pin.simulate` takes.

    Parameters
    ----------
    experiment
        Arm, plant, reference, sensors, step; its duration does not end it.
    controller
        The law.
    horizon
        Longest time that it will run [s]; fractional memories are fitted for it.

    Attributes
    ----------
    q, v, q_ref, torque
        At the last tick, (n,): [rad], [rad/s], [rad], [N m].
    fault
        What ended it; empty while it goes on.
    """

    def __init__(
        self, experiment: Experiment, controller: Controller, *, horizon: float = 3600.0
    ) -> None:
        plant = plant_of(experiment)
        n, self._h = experiment.arm.n, experiment.step
        self._experiment, self._plant = experiment, plant
        self._state = type(controller).start_many(
            [controller], experiment.arm, step=self._h, horizon=max(horizon, 2.0 * self._h)
        )
        self._motion = integrator(experiment.integrator, [plant], self._h)
        self._sensors = (
            None if experiment.sensors is None
            else SensorState([experiment.sensors], [experiment.seed], n, self._h)
        )  # fmt: skip
        self._limit = plant.effort_limit
        self._q = np.array(experiment.q0).reshape(1, n)
        self._v = np.array(experiment.v0).reshape(1, n)
        self._next = np.zeros((2, 1, n))
        self._torque = np.zeros((1, n))
        self._references = np.zeros((3, _BLOCK, 1, n))
        self._forces = np.zeros((len(self._motion.offsets), _BLOCK, 1, n))
        self._force = np.zeros((len(self._motion.offsets), 1, n))
        self._push = np.zeros(n)
        self._push_until = np.zeros(n, dtype=np.int64)
        self._tick = 0
        self.fault = ""
        self.q, self.v = self._q[0].copy(), self._v[0].copy()
        self.q_ref, self.torque = np.zeros(n), np.zeros(n)

    @property
    def t(self) -> float:
        """Time of the next tick [s]."""
        return self._tick * self._h

    def push(self, joint: str | int, torque: float, duration: float) -> None:
        """Disturb a joint by a torque [N m] for `duration` [s] from now."""
        j = self._experiment.arm.joint_index(joint)
        self._push[j] = checks.number("torque", torque)
        ticks = max(round(checks.number("duration", duration, above=0.0) / self._h), 1)
        self._push_until[j] = self._tick + ticks

    def _sample(self) -> None:
        """Sample the next block of the reference and the disturbance."""
        t = np.arange(self._tick, self._tick + _BLOCK, dtype=np.float64) * self._h
        for part, values in zip(self._references, self._experiment.motion(t), strict=True):
            part[:, 0] = values
        if self._plant.disturbance is not None:
            for part, offset in zip(self._forces, self._motion.offsets, strict=True):
                part[:, 0] = self._plant.disturbance.sample(t + offset * self._h)

    def tick(self) -> bool:
        """Measure, control, apply and advance by one step; False once the robot ran away."""
        k = self._tick % _BLOCK
        if k == 0:
            self._sample()
        q, v = self._q, self._v
        measured = (q, v) if self._sensors is None else self._sensors.measure(q, v)
        q_ref, v_ref, a_ref = self._references[:, k]
        u = self._state.torque(measured[0], measured[1], q_ref, v_ref, a_ref)
        np.clip(u, -self._limit, self._limit, out=self._torque)
        self.q[:], self.v[:], self.q_ref[:] = q[0], v[0], q_ref[0]
        self.torque[:] = self._torque[0]
        np.add(self._forces[:, k], self._push * (self._tick < self._push_until), out=self._force)
        self._motion.advance(q, v, self._torque, self._force, self._next[0], self._next[1])
        self._q[:], self._v[:] = self._next
        self._tick += 1
        speed = np.abs(self._v[0])
        # Written so that NaN counts as a runaway.
        if (speed <= self._experiment.runaway_speed).all() and np.isfinite(self._torque).all():
            return True
        j = int(np.argmax(~(speed <= self._experiment.runaway_speed)))
        self.fault = (
            f"ended at {self.t:g} s: {self._experiment.arm.joint_names[j]} at "
            f"{speed[j]:.3g} rad/s (limit {self._experiment.runaway_speed:g})"
        )
        return False
