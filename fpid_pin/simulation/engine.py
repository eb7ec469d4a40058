"""The engine: one robot, its controller and its plant, a block of ticks at a time.

A tick: measure, torque, the drives' limits, record, one step of the motion with the torque held.
The loop over ticks is `kernels.rollout.rollout`, one compiled call, and the same line by line in
`Robot._tick_by_tick` for laws in Python and Pinocchio's dynamics. `entry` starts the robots.
Robots do not see each other: a run has the same bits whatever runs beside it.
"""

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.state import State
from fpid_pin.costs import BLOCK_ROWS, SETTLING_BAND, Rows
from fpid_pin.exceptions import SimulationError
from fpid_pin.kernels import records
from fpid_pin.kernels.plant import (
    apply_actuators,
    apply_dry_friction,
    finish_runge_kutta,
    has_diverged,
    move,
    runge_kutta_stage,
)
from fpid_pin.kernels.records import FRAME, MEASURE, PLANT, SENSOR, Sensing
from fpid_pin.kernels.rigid_body import factor_symmetric
from fpid_pin.kernels.rollout import keep_signals, load_reference, measure, measure_joints, rollout
from fpid_pin.simulation.experiment import Experiment, Outcome, ResolvedPlant, Sensors

# RK4 is stable on the negative real axis to -2.785; beyond half of it, it is not accurate either.
_RK4_REACH = 1.4
#: Fractional operators are fitted to the first of these that a run fits in [s]: runs of different
#: durations then agree to the last bit as long as both last.
HORIZONS = tuple(base * 10.0**decade for decade in range(7) for base in (20.0, 60.0))


def horizon_of(duration: float) -> float:
    """Return the horizon that fractional operators of a run of `duration` [s] are fitted for."""
    return next((horizon for horizon in HORIZONS if duration <= horizon), duration)


class SensorState:
    """The sensors of one run, None exact, as records for the kernels; `seed` is the noise's."""

    def __init__(self, sensors: Sensors | None, seed: int, n: int, step: float) -> None:
        joints = np.zeros(0 if sensors is None else n, SENSOR)
        delay, noisy = 0, False
        if sensors is not None:
            for name, field in (
                ("noise_q", "position_noise"), ("noise_v", "velocity_noise"),
                ("bias", "velocity_bias"), ("resolution", "position_resolution"),
            ):  # fmt: skip
                joints[name] = checks.per_joint(f"sensors.{field}", getattr(sensors, field), n)
            joints["keep"] = np.exp(-sensors.velocity_cutoff * step)
            joints["gain"] = (1.0 - joints["keep"]) / step
            joints["delay"] = delay = sensors.delay
            joints["derived"] = sensors.velocity == "differentiated"
            noisy = bool(joints["noise_q"].any() or joints["noise_v"].any())
        self._generator = np.random.default_rng(seed)
        noise = np.zeros((BLOCK_ROWS if noisy else 0, 2, n))
        self._records = Sensing(joints, np.zeros((1 + delay, 2, n)), noise)
        self._drawn = 0

    def records(self, first: int, count: int) -> Sensing:
        """Return the records for rows from `first` on, which end with their block at the latest.

        Noise is drawn a block at a time: it does not depend on how many ticks are made at once.
        """
        noise = self._records.noise
        if len(noise) and first + count > self._drawn:
            noise[:] = self._generator.standard_normal(noise.shape)
            self._drawn += len(noise)
        return self._records


class Block:
    """Some consecutive rows: what is given from outside, and room for what robots make of it.

    Robots of one experiment share a block, one after another. It has `count` rows from number
    `first` of the run on, and room for so many of a law's signals.
    """

    def __init__(self, experiment: Experiment, first: int, count: int, signals: int = 0) -> None:
        step, n = experiment.step, experiment.arm.n
        t: FloatArray = np.arange(first, first + count, dtype=np.float64) * step
        self.first, self.count, self.t = first, count, t
        self.reference: FloatArray = np.array(experiment.motion(t))
        # The parts of a step that the integrator looks at.
        parts = (0.0, 0.5, 1.0) if experiment.integrator == "rk4" else (0.0,)
        self.forces: FloatArray = np.zeros((len(parts), count, n))
        if experiment.resolved.disturbance is not None:
            for k, part in enumerate(parts):
                self.forces[k] = experiment.disturbance(t + part * step)
        self.motion: FloatArray = np.empty((3, count, n))
        self.kept: FloatArray = np.empty((signals, count, n))


class PinocchioDynamics:
    """Dynamics by Pinocchio itself, one robot and one call at a time: the reference.

        M(q) q'' + C(q, q') q' + G(q) + F_v q' + F_d sgn(q') = u + d(t)                     (6)

    All else of a tick is what the compiled dynamics have, too.
    """

    def __init__(self, plant: ResolvedPlant, experiment: Experiment) -> None:
        self.step, self.euler = experiment.step, experiment.integrator != "rk4"
        self.nominal = experiment.arm.model
        self.nominal_data = self.nominal.createData()
        self.true = plant.arm.model.copy()
        if self.euler:
            # (M + h F_v) a = tau - F_v v - C v - G: viscous friction is implicit in the speed.
            extra = self.step * plant.viscous_friction
            self.true.armature = np.array(self.true.armature) + extra
        self.true_data = self.true.createData()

    def write_terms(self, state: State) -> None:
        """Write what the nominal model says of this sample, as `tick.evaluate_model` does."""
        model, data = self.nominal, self.nominal_data
        robot, terms, joints = state.c.robot[0], state.c.terms, state.joints
        q, v, q_ref, v_ref, a_ref = state.inputs
        if robot.uses_model:
            w, a = np.array(joints["w"]), np.array(joints["a"])
            # C(q, v) w is bilinear and symmetric: with c(x) = C(q, x) x it is
            # c((v + w)/2) - c((v - w)/2).
            terms[records.LAW_TERM] = pin.rnea(model, data, q, 0.5 * (v + w), a)
            if not np.array_equal(v, w):
                terms[records.LAW_TERM] -= self._coriolis(q, 0.5 * (v - w))
        if robot.feedforward:
            terms[records.FEEDFORWARD] = pin.rnea(model, data, q_ref, v_ref, a_ref)
        if robot.paper and robot.acting:
            terms[records.GRAVITY] = pin.computeGeneralizedGravity(model, data, q)
            terms[records.CORIOLIS] = self._coriolis(q, v)
            state.c.mass[:] = pin.crba(model, data, q).T  # its upper half is filled, ours the lower
        if robot.observes or robot.sampled:
            v_hat = np.array(joints["v_hat"])
            terms[records.BIAS] = pin.nonLinearEffects(model, data, q, v_hat)
            state.c.mass[:] = pin.crba(model, data, q).T

    def _coriolis(self, q: FloatArray, v: FloatArray) -> FloatArray:
        model, data = self.nominal, self.nominal_data
        bias = np.array(pin.nonLinearEffects(model, data, q, v))
        return np.asarray(bias - pin.computeGeneralizedGravity(model, data, q))

    def move(
        self, plant: records.Plant, has_dry_friction: bool, forces: FloatArray, k: int
    ) -> None:
        """Take the true arm one step further with `plant.tau` held: see `kernels.plant.move`."""
        plant.a[:] = pin.aba(self.true, self.true_data, plant.q, plant.v, plant.tau)
        if self.euler:
            plant.v[:] += self.step * plant.a
            if has_dry_friction:
                plant.mass[:] = pin.crba(self.true, self.true_data, plant.q).T
                factor_symmetric(plant.mass)
                apply_dry_friction(plant.mass, plant.joints, plant.v, plant.workspace, self.step)
            plant.q[:] += self.step * plant.v
            return
        stages = plant.workspace[records.WORKSPACE + 2 * len(plant.q) :]
        stages[3], stages[4] = plant.v, plant.a
        for i in range(1, 4):
            runge_kutta_stage(
                plant.joints, plant.q, plant.v, plant.tau, stages, forces, k, i, self.step
            )
            stages[4 + 2 * i] = pin.aba(self.true, self.true_data, *stages[:3])
        finish_runge_kutta(plant.q, plant.v, stages, self.step)


class Robot:
    """One experiment under one controller, advanced a block of rows at a time.

    `state` is the controller's (`control.state.State`), `keep` names its signals to record,
    and `limit` is that of the torque [N m], (n,), which figures of merit are measured against, by
    `sums`; None: they are not wanted. `row` is the number of the next row, `arrays` are the true
    arm's, of which `q`, `v` and `torque`, (n,), are those of now and of the last tick, live, and
    `outcome` is how it ended early; None while it goes on.
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
        self.experiment, self.state, self.row = experiment, state, 0
        self.outcome: Outcome | None = None
        plant = self.plant = experiment.resolved
        joints, bodies = np.zeros(n, PLANT), plant.arm.bodies.copy()
        joints["limit"], joints["viscous"] = plant.effort_limit, plant.viscous_friction
        joints["runaway"], joints["dry"] = experiment.runaway_speed, plant.dry_friction
        stages = 0
        if experiment.integrator == "rk4":
            _refuse_stiff(plant, h)
            stages = 11
        else:
            bodies["armature"] += h * plant.viscous_friction
        zero = np.zeros
        self.arrays = records.Plant(
            joints=joints, q=np.array(experiment.q0), v=np.array(experiment.v0), a=zero(n),
            tau=zero(n), bodies=bodies, frames=zero(n + 1, FRAME),
            gravity=np.array(plant.arm.model.gravity.linear), mass=zero((n, n)),
            workspace=zero((records.WORKSPACE + 2 * n + stages, n)),
        )  # fmt: skip
        self.q, self.v, self.torque = self.arrays.q, self.arrays.v, state.torque
        self._has_dry_friction = bool(plant.dry_friction.any())
        self._sensors = SensorState(experiment.sensors, experiment.seed, n, h)
        self.keep = [name for name in keep if name in state.controller.shown]
        self._own = [name for name in keep if name in state.shown]
        self._columns = state.columns(self.keep)
        self.sums = np.zeros(n if limit is not None else 0, MEASURE)
        if limit is not None:
            self.sums["limit"], self.sums["band"] = limit, SETTLING_BAND
        self._limit = experiment.torque_limit if limit is None else limit
        self._pinocchio = PinocchioDynamics(plant, experiment) if dynamics == "pinocchio" else None

    def advance(self, block: Block, count: int | None = None) -> Rows:
        """Make the next ticks within a block, and return their rows: views of its arrays.

        At most `count` of them; None: to the block's end. The last row of a completed run has a
        torque that is not applied.
        """
        e, first, start = self.experiment, self.row, self.row - block.first
        count = block.count - start if count is None else count
        rows = records.Rows(
            block.reference, block.forces, block.motion, self._columns, block.kept, self.sums
        )
        own: dict[str, list[FloatArray]] = {name: [] for name in self._own}
        sensing = self._sensors.records(first, count)
        if self._pinocchio is None and not self.state.in_python:
            counts = np.array(
                [first, count, start, e.rows - 1, self._has_dry_friction], dtype=np.int64
            )
            c, inputs, torque = self.state.c, self.state.inputs, self.state.torque
            ended = int(rollout(c, self.arrays, sensing, rows, inputs, torque, counts))
        else:
            ended = self._tick_by_tick(rows, sensing, count, start, own)
        self.row += count if ended < 0 else min(ended - first + 1, count)
        if ended >= 0 and self.outcome is None:
            self.outcome = self._divergence(ended)
        valid = count if ended < 0 else min(ended - first, count)
        part = slice(start, start + valid)
        q, v, torque = block.motion[:, part]
        q_ref, v_ref = block.reference[:2, part]
        signals = {name: block.kept[k, part] for k, name in enumerate(self.keep)}
        if "lyapunov" in signals:
            signals["lyapunov"] = signals["lyapunov"][:, 0]
        signals |= {name: np.array(values[:valid]) for name, values in own.items()}
        return Rows(
            first, e.step, block.t[part], q, v, q_ref, v_ref, torque, signals, self._limit, e.arm
        )  # fmt: skip

    def _tick_by_tick(
        self, rows: records.Rows, sensing: records.Sensing, count: int, start: int,
        own: dict[str, list[FloatArray]],
    ) -> int:  # fmt: skip
        """Make ticks from Python, for Pinocchio's dynamics and laws in Python: see `rollout`."""
        state, plant, h = self.state, self.arrays, self.experiment.step
        pinocchio, last = self._pinocchio, self.experiment.rows - 1
        # Estimates need not be those of a body, which Pinocchio's would have to be.
        estimates = state.controller.estimates_model
        model = None if pinocchio is None or estimates else pinocchio.write_terms
        for row in range(start, start + count):
            number = self.row + row - start
            measure(*sensing, plant.q, plant.v, number, state.inputs)
            load_reference(rows.reference, row, state.inputs)
            try:
                state.tick(model)
            except SimulationError as error:
                self.outcome = Outcome(False, number * h, cause=str(error))
                return number
            if apply_actuators(
                plant.joints, plant.q, plant.v, state.torque, rows.forces, rows.motion, row,
                plant.tau,
            ):  # fmt: skip
                return number
            keep_signals(state.c.numbers, rows.columns, rows.kept, row)
            if number < last:
                measure_joints(rows.sums, rows.reference, rows.motion, row, number, last // 2, h)
            for name, values in own.items():
                values.append(np.array(state.shown[name]))
            if pinocchio is None:
                move(plant, self._has_dry_friction, rows.forces, row, h)
            else:
                pinocchio.move(plant, self._has_dry_friction, rows.forces, row)
            if has_diverged(plant.joints, plant.q, plant.v):
                return number + 1
        return -1

    def _divergence(self, row: int) -> Outcome:
        """Return which joint ended the run, and why."""
        torque, limit = self.torque, self.arrays.joints["runaway"]
        slow = np.abs(self.v) <= limit
        j = int(np.argmin(slow & np.isfinite(self.q) & np.isfinite(torque)))
        if not np.isfinite(self.v[j]):
            cause = "speed is not finite"
        elif not slow[j]:
            unit = f"{self.experiment.arm.units[j]}/s"
            cause = f"speed {abs(self.v[j]):.3g} {unit} is beyond {limit[j]:g} {unit}"
        else:
            cause = f"{'angle' if np.isfinite(torque[j]) else 'torque'} is not finite"
        return Outcome(False, row * self.experiment.step, self.experiment.arm.joint_names[j], cause)


def _refuse_stiff(plant: ResolvedPlant, step: float) -> None:
    """Refuse a plant that Runge-Kutta's rule cannot follow.

    Dry friction jumps, so that the order is lost and joints chatter; viscous friction may be too
    stiff for an explicit rule at this step.
    """
    arm = plant.arm
    if plant.dry_friction.any():
        joint = arm.joint_names[int(np.argmax(plant.dry_friction > 0.0))]
        raise SimulationError(
            f"rk4: dry friction on joint {joint} jumps with the sign of its speed, which no smooth "
            "rule follows; use semi_implicit_euler, which treats it implicitly"
        )
    if plant.viscous_friction.any():
        rates = np.linalg.eigvals(
            np.linalg.solve(arm.mass_matrix(arm.home), np.diag(plant.viscous_friction))
        )
        fastest = float(np.abs(rates).max())
        if step * fastest > _RK4_REACH:
            raise SimulationError(
                f"rk4: viscous friction decays at {fastest:.3g} 1/s, too stiff for a step of "
                f"{step:g} s (at most {_RK4_REACH / fastest:.2g} s); use semi_implicit_euler, "
                "which treats it implicitly"
            )


class Simulation:
    """One robot that is advanced tick by tick, by whoever shows it or pushes it.

    Its dynamics are compiled unless the experiment says otherwise, `horizon` is the longest time
    that it will go on [s], None being the experiment's duration, and `q_ref` the reference of the
    last tick [rad], (n,).
    """

    def __init__(
        self, experiment: Experiment, controller: Controller, *, horizon: float | None = None
    ) -> None:
        longest = horizon_of(experiment.duration if horizon is None else horizon)
        state = State(controller, experiment.arm, step=experiment.step, horizon=longest)
        self.robot = Robot(experiment, state, dynamics=experiment.dynamics or "compiled")
        self._block = Block(experiment, 0, BLOCK_ROWS)
        self._push_ends = np.zeros(experiment.arm.n, dtype=np.int64)
        self.q_ref: FloatArray = np.array(experiment.q0)

    @property
    def t(self) -> float:
        """Time of the next tick [s]."""
        return self.robot.row * self.robot.experiment.step

    def push(self, joint: str | int, torque: float, duration: float) -> None:
        """Disturb a joint by `torque` [N m] for `duration` [s] from now."""
        e = self.robot.experiment
        ticks = max(round(checks.number("duration", duration, above=0.0) / e.step), 1)
        j = e.arm.joint_index(joint)
        self.robot.arrays.joints["push"][j] = checks.number("torque", torque)
        self._push_ends[j] = self.robot.row + ticks

    def tick(self) -> None:
        """Make one tick; a law of one's own that fails is a SimulationError."""
        robot = self.robot
        place = robot.row - self._block.first
        if place == BLOCK_ROWS:
            self._block, place = Block(robot.experiment, robot.row, BLOCK_ROWS), 0
        robot.arrays.joints["push"][self._push_ends <= robot.row] = 0.0
        robot.advance(self._block, 1)
        self.q_ref = self._block.reference[0, place]
        if robot.outcome is not None and not robot.outcome.joint:
            raise SimulationError(robot.outcome.cause)
