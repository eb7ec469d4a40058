"""The engine: one robot, its controller and its plant, a block of ticks at a time.

A tick: measure, torque, the drives' limits, record, one step of the motion with the torque held.
Robots do not see each other: a run has the same bits whatever runs beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from fpid_pin import checks
from fpid_pin.arms.bodies import bodies_of
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.start import start_all
from fpid_pin.control.state import State
from fpid_pin.costs import SETTLING_BAND, Rows
from fpid_pin.exceptions import SimulationError
from fpid_pin.kernels import records
from fpid_pin.kernels.metrics import measure_joints
from fpid_pin.kernels.plant import apply_actuators, has_diverged, move
from fpid_pin.kernels.records import FRAME, MEASURE, PLANT
from fpid_pin.kernels.rollout import keep_signals, load_reference, rollout
from fpid_pin.kernels.sensors import measure
from fpid_pin.simulation.blocks import BLOCK_ROWS, Outcome
from fpid_pin.simulation.experiment import Experiment, plant_of
from fpid_pin.simulation.pinocchio_dynamics import PinocchioDynamics
from fpid_pin.simulation.plant import ResolvedPlant, refuse_stiff
from fpid_pin.simulation.sensors import SensorState

#: Fractional operators are fitted to the first of these that a run fits in [s]: runs of different
#: durations then agree to the last bit as long as both last.
HORIZONS = tuple(base * 10.0**decade for decade in range(7) for base in (20.0, 60.0))


def horizon_of(duration: float) -> float:
    """Return the horizon that fractional operators of a run of `duration` [s] are fitted for."""
    return next((horizon for horizon in HORIZONS if duration <= horizon), duration)


class Samples:
    """What is given from outside in some consecutive rows: reference, and disturbance.

    Attributes
    ----------
    reference
        q_d, its rate and acceleration, (3, K, n).
    forces
        d(t) at the parts of each step that the integrator looks at, (parts, K, n).
    """

    def __init__(self, experiment: Experiment, plant: ResolvedPlant, first: int, rows: int) -> None:
        step, n = experiment.step, experiment.arm.n
        t: FloatArray = np.arange(first, first + rows, dtype=np.float64) * step
        self.reference: FloatArray = np.array(experiment.motion(t))
        parts = (0.0, 0.5, 1.0) if experiment.integrator == "rk4" else (0.0,)
        self.forces: FloatArray = np.zeros((len(parts), rows, n))
        if plant.disturbance is not None:
            for k, part in enumerate(parts):
                self.forces[k] = plant.disturbance.sample(t + part * step)


class Robot:
    """One experiment under one controller, advanced a block of rows at a time.

    Parameters
    ----------
    experiment
        What it is.
    state
        Of its controller: see `control.state.start_all`.
    dynamics
        ``"pinocchio"`` or ``"compiled"``.
    keep
        Names of the controller's signals that blocks hold.
    limit
        Of the torque [N m], (n,), to measure figures of merit against; None: they are not wanted.

    Attributes
    ----------
    row : int
        Number of the next row: ticks made.
    q, v, torque : ndarray, (n,)
        Joint angles [rad] and rates [rad/s] now, and the torque of the last tick [N m]; live.
    outcome : Outcome or None
        How and when it ended early; None while it goes on.
    sums
        What figures of merit are made of, `kernels.metrics.MEASURE`, (n,), or none.
    """

    def __init__(
        self,
        experiment: Experiment,
        state: State,
        *,
        dynamics: str,
        keep: Sequence[str] = (),
        limit: FloatArray | None = None,
    ) -> None:
        n, h = experiment.arm.n, experiment.step
        self.experiment, self.state = experiment, state
        self.row = 0
        self.outcome: Outcome | None = None
        plant = self.plant = plant_of(experiment)
        euler = experiment.integrator != "rk4"
        if not euler:
            refuse_stiff(plant, h)
        joints = np.zeros(n, PLANT)
        joints["limit"], joints["viscous"] = plant.effort_limit, plant.viscous_friction
        joints["runaway"], joints["dry"] = experiment.runaway_speed, plant.dry_friction
        bodies = bodies_of(plant.arm).copy()
        if euler:
            bodies["armature"] += h * plant.viscous_friction
        zero = np.zeros
        self._arrays = records.Plant(
            joints=joints, q=np.array(experiment.q0), v=np.array(experiment.v0), a=zero(n),
            tau=zero(n), bodies=bodies, frames=zero(n + 1, FRAME),
            gravity=np.array(plant.arm.model.gravity.linear), mass=zero((n, n)),
            room=zero((records.ROOM + 2 * n + (0 if euler else 11), n)),
        )  # fmt: skip
        self.q, self.v, self.torque = self._arrays.q, self._arrays.v, state.torque
        self._rubs = bool(plant.dry_friction.any())
        self._sensors = SensorState(experiment.sensors, experiment.seed, n, h)
        self._keep = [name for name in keep if name in state.shown_names()]
        self._own = [name for name in keep if name in state.shown]
        self._columns = state.columns(self._keep)
        self.sums = np.zeros(n if limit is not None else 0, MEASURE)
        if limit is not None:
            self.sums["limit"], self.sums["band"] = limit, SETTLING_BAND
        self._limit = experiment.torque_limit if limit is None else limit
        self._pinocchio = PinocchioDynamics(plant, experiment) if dynamics == "pinocchio" else None
        self._push_ends = np.zeros(n, dtype=np.int64)

    def buffer(self, rows: int = BLOCK_ROWS) -> tuple[FloatArray, FloatArray]:
        """Return room for the rows of a block, of motion and of kept signals."""
        n, kept = len(self.q), len(self._keep)
        return np.zeros((3, rows, n)), np.zeros((kept, rows, n))

    def advance(
        self, samples: Samples, buffer: tuple[FloatArray, FloatArray], count: int, start: int = 0
    ) -> Rows:
        """Make ticks, `count` of them at most, and return their rows: views of `buffer`.

        The last row of a completed run has a torque that is not applied.

        Parameters
        ----------
        samples
            Of these rows, the first being row `start` of them.
        buffer
            See `buffer`.
        """
        first, motion, kept = self.row, *buffer
        self._arrays.joints["push"][self._push_ends <= first] = 0.0
        rows = records.Rows(
            samples.reference, samples.forces, motion, self._columns, kept, self.sums
        )
        own: dict[str, list[FloatArray]] = {name: [] for name in self._own}
        sensing = self._sensors.records(first, count)
        last = self.experiment.rows - 1
        if self._pinocchio is None and not self.state.in_python:
            counts = np.array([first, count, start, last, self._rubs], dtype=np.int64)
            state = self.state
            ended = int(
                rollout(
                    state.c, self._arrays, sensing, rows, state.inputs, state.torque, counts
                )
            )  # fmt: skip
            made = count if ended < 0 else min(ended - first + 1, count)
        else:
            ended, made, fault = self._tick_by_tick(rows, sensing, count, start, last, own)
            if fault:
                self.outcome = Outcome(False, (first + made) * self.experiment.step, cause=fault)
        self.row += made
        if ended >= 0:
            self._end(ended)
        valid = made if ended < 0 else ended - first
        part = slice(start, start + min(valid, made))
        q, v, torque = motion[:, part]
        q_ref, v_ref = samples.reference[:2, part]
        signals = {name: kept[k, part] for k, name in enumerate(self._keep)}
        if "lyapunov" in signals:
            signals["lyapunov"] = signals["lyapunov"][:, 0]
        signals |= {name: np.array(values[: len(q)]) for name, values in own.items()}
        e = self.experiment
        t = e.step * np.arange(first, first + len(q), dtype=np.float64)
        return Rows(
            first, e.step, t, q, v, q_ref, v_ref, torque, signals, self._limit, e.arm
        )  # fmt: skip

    def _tick_by_tick(
        self,
        rows: records.Rows,
        sensing: records.Sensing,
        count: int,
        start: int,
        last: int,
        own: Any,
    ) -> tuple[int, int, str]:
        """Make ticks from Python: for Pinocchio's dynamics, and for laws in Python.

        Returns the row from which on nothing counts, or -1; the ticks made; what the law did wrong.
        """
        state, plant, h = self.state, self._arrays, self.experiment.step
        pinocchio = self._pinocchio
        # Estimates need not be those of a body, which Pinocchio's would have to be.
        estimates = state.controller.estimates_model
        model = None if pinocchio is None or estimates else pinocchio.write_terms
        for k in range(count):
            number, row = self.row + k, start + k
            measure(*sensing, plant.q, plant.v, number, state.inputs)
            load_reference(rows.reference, row, state.inputs)
            try:
                state.tick(model)
            except SimulationError as error:
                return -1, k, str(error)
            if apply_actuators(
                plant.joints, plant.q, plant.v, state.torque, rows.forces, rows.motion, row,
                plant.tau,
            ):  # fmt: skip
                return number, k + 1, ""
            keep_signals(state.c.numbers, rows.columns, rows.kept, row)
            if number < last:
                measure_joints(rows.sums, rows.reference, rows.motion, row, number, last // 2, h)
            for name, values in own.items():
                values.append(np.array(state.shown[name]))
            if pinocchio is None:
                move(plant, self._rubs, rows.forces, row, h)
            else:
                pinocchio.move(plant, self._rubs, rows.forces, row)
            if has_diverged(plant.joints, plant.q, plant.v):
                return number + 1, k + 1, ""
        return -1, count, ""

    def push(self, joint: int, torque: float, ticks: int) -> None:
        """Disturb a joint by `torque` [N m] for so many ticks from now; see `Simulation.push`."""
        self._arrays.joints["push"][joint] = torque
        self._push_ends[joint] = self.row + ticks

    def _end(self, row: int) -> None:
        """Note which joint ended the run, and why."""
        torque, limit = self.state.torque, self._arrays.joints["runaway"]
        slow = np.abs(self.v) <= limit
        sound = slow & np.isfinite(self.q) & np.isfinite(torque)
        j = int(np.argmin(sound))
        speed = self.v[j]
        if not np.isfinite(speed):
            cause = "speed is not finite"
        elif not slow[j]:
            cause = f"speed {abs(speed):.3g} rad/s is beyond {limit[j]:g} rad/s"
        elif not np.isfinite(torque[j]):
            cause = "torque is not finite"
        else:
            cause = "angle is not finite"
        joint = self.experiment.arm.joint_names[j]
        self.outcome = Outcome(False, row * self.experiment.step, joint, cause)


class Simulation:
    """One robot that is advanced a few ticks at a time, by whoever shows it or pushes it.

    Parameters
    ----------
    experiment, controller
        What is simulated, by compiled dynamics unless the experiment says otherwise.
    horizon
        Longest time that it will go on [s]; None: the experiment's duration.

    Attributes
    ----------
    robot
        See `Robot`.
    q_ref : ndarray, (n,)
        Reference of the last tick [rad].
    """

    def __init__(
        self, experiment: Experiment, controller: Controller, *, horizon: float | None = None
    ) -> None:
        longest = horizon_of(experiment.duration if horizon is None else horizon)
        state = start_all([controller], experiment.arm, step=experiment.step, horizon=longest)[0]
        self.robot = Robot(experiment, state, dynamics=experiment.dynamics or "compiled")
        self._buffer = self.robot.buffer()
        self._samples: Samples | None = None
        self.q_ref: FloatArray = np.array(experiment.q0)

    @property
    def t(self) -> float:
        """Time of the next tick [s]."""
        return self.robot.row * self.robot.experiment.step

    def push(self, joint: str | int, torque: float, duration: float) -> None:
        """Disturb a joint by `torque` [N m] for `duration` [s] from now."""
        e = self.robot.experiment
        ticks = max(round(checks.number("duration", duration, above=0.0) / e.step), 1)
        self.robot.push(e.arm.joint_index(joint), checks.number("torque", torque), ticks)

    def tick(self) -> None:
        """Make one tick.

        Raises
        ------
        SimulationError
            A law of one's own that raised, or returned something of another shape.
        """
        robot = self.robot
        place = robot.row % BLOCK_ROWS
        if place == 0 or self._samples is None:
            first = robot.row - place
            self._samples = Samples(robot.experiment, robot.plant, first, BLOCK_ROWS)
        robot.advance(self._samples, self._buffer, 1, place)
        self.q_ref = self._samples.reference[0, place]
        if robot.outcome is not None and not robot.outcome.joint:
            raise SimulationError(robot.outcome.cause)
