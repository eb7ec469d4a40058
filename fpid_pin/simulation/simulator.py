"""The one engine: any number of robots, their controllers and plants, a tick at a time.

A tick: measure, torque, the drives' limits, record, one step of the motion with the torque held.
Which runs share a tick never changes a bit of any of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fpid_pin import checks
from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.integrators import INTEGRATORS, CompiledEuler, Integrator
from fpid_pin.simulation.plant import ResolvedPlant, plant_of
from fpid_pin.simulation.recorders import BLOCK_ROWS, Block, Outcome
from fpid_pin.simulation.sensors import SensorState

#: Fractional operators are fitted to the first of these that a run fits in [s]: runs of different
#: durations then agree to the last bit as long as both last.
HORIZONS = tuple(base * 10.0**decade for decade in range(7) for base in (20.0, 60.0))

#: Signals of a law that a flight keeps, in the order of `kernels.flight`.
KEPT = ("kp", "ki", "kd", "u_fpid", "u_s", "s", "integral_order", "derivative_order")


def horizon_of(duration: float) -> float:
    """Return the horizon that fractional operators of a run of `duration` [s] are fitted for."""
    return next((horizon for horizon in HORIZONS if duration <= horizon), duration)


class Simulator:
    """Runs that share arm, step, integrator and kind of law, a tick at a time.

    Parameters
    ----------
    experiments, controllers
        One a run.
    horizon
        Longest time that it will go on [s]; None: the longest duration.
    keep
        Names of the controllers' signals that blocks hold; None: all of them.

    Attributes
    ----------
    row : int
        Number of the next row: ticks made.
    q, v, q_ref, torque : ndarray, (runs, n)
        Joint angles [rad] and rates [rad/s] now, their reference, and what the drives gave at the
        last tick [N m]; live buffers.
    ends : list of Outcome or None
        How and when a run ended early; None while it goes on.

    Raises
    ------
    ArgumentError, SimulationError
        Descriptions that do not fit each other.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        controllers: Sequence[Controller],
        *,
        horizon: float | None = None,
        keep: Sequence[str] | None = (),
    ) -> None:
        # Imported late: it loads numba.
        from fpid_pin.kernels import motion

        self._kernels: Any = motion
        first = experiments[0]
        runs, n, h = len(experiments), first.arm.n, first.step
        self._experiments, self.step = list(experiments), h
        resolved = {id(e): plant_of(e) for e in experiments}
        plants = [resolved[id(e)] for e in experiments]
        longest = max(e.duration for e in experiments) if horizon is None else horizon
        self._state = type(controllers[0]).start_many(
            controllers, first.arm, step=h, horizon=horizon_of(longest)
        )
        self.row, self._block_row = 0, 0
        self.ends: list[Outcome | None] = [None] * runs
        self._alive = self._state.alive
        self._last = np.full(runs, np.iinfo(np.int64).max)  # rows that count
        # What the laws see; its first two rows are the state itself where no run has sensors.
        self._seen = np.zeros((5, runs, n))
        self.q_ref = self._seen[2]
        self._sensors = None
        if any(e.sensors is not None for e in experiments):
            seeds = [e.seed for e in experiments]
            self._sensors = SensorState([e.sensors for e in experiments], seeds, n, h)
        self._x = self._seen[:2] if self._sensors is None else np.zeros((2, runs, n))
        self.q, self.v = self._x
        self.q[:], self.v[:] = ([getattr(e, name) for e in experiments] for name in ("q0", "v0"))
        self._plants = np.zeros((runs, n), motion.PLANT)
        self._plants["limit"] = [p.effort_limit for p in plants]
        self._plants["viscous"] = [p.viscous_friction for p in plants]
        self._plants["runaway"] = [[e.runaway_speed] for e in experiments]
        self._push_ends = np.zeros((runs, n), dtype=np.int64)
        self._pushed = False
        rule: Any = INTEGRATORS[first.integrator, first.dynamics]
        self._motion: Integrator = rule(plants, h, self._x)
        self._references = _Table([(e.reference, e.motion) for e in experiments], 3, n)
        forces = [(p.disturbance, _sampler(p, n)) for p in plants]
        self._forces = _Table(forces, len(self._motion.offsets), n)
        self._plants["reference"] = self._references.group[:, np.newaxis]
        self._plants["disturbance"] = self._forces.group[:, np.newaxis]
        self._rows = np.zeros((3, BLOCK_ROWS, runs, n))
        self.torque: FloatArray = self._rows[2, 0]
        live = self._state.signals()
        names = list(live) if keep is None else [name for name in live if name in keep]
        self._kept = {name: np.zeros((BLOCK_ROWS, *live[name].shape)) for name in names}
        self._flight = self._prepare_flight(names)
        self._live = [(live[name], self._kept[name]) for name in names]

    @property
    def t(self) -> float:
        """Time of the next tick [s]."""
        return self.row * self.step

    @property
    def alive(self) -> bool:
        """Whether a run still goes on."""
        return bool(self._alive.any())

    def push(self, joint: str | int, torque: float, duration: float, run: int = 0) -> None:
        """Disturb a joint of a run by `torque` [N m] for `duration` [s] from now."""
        j = self._experiments[run].arm.joint_index(joint)
        self._plants["push"][run, j] = checks.number("torque", torque)
        ticks = max(round(checks.number("duration", duration, above=0.0) / self.step), 1)
        self._push_ends[run, j] = self.row + ticks
        self._pushed = True

    def tick(self, count: int = 1) -> None:
        """Make `count` ticks; those of one block at most, for whoever takes blocks.

        Raises
        ------
        SimulationError
            A law of one's own that raised, or returned something of another shape.
        """
        while count > 0:
            first = self.row % BLOCK_ROWS
            if first == 0:
                self._sample()
            some = min(count, BLOCK_ROWS - first)
            self._tick(first, some)
            count -= some

    def _tick(self, first: int, count: int) -> None:
        """Make the ticks of rows `first` and on of this block."""
        arrive, drive, move = self._kernels.arrive, self._kernels.drive, self._motion.advance
        alive, plants, x, rows = self._alive, self._plants, self._x, self._rows
        state, sensors, seen, kept = self._state, self._sensors, self._seen, self._live
        references, forces = self._references.values, self._forces.values
        now, torque, tau = forces[0], state.torque, self._motion.tau
        if first == 0:
            arrive(alive, plants, x, references, 0, seen)
        if self._flight is not None and not self._pushed:
            self._fly(first, count, now)
            return
        for k in range(first, first + count):
            if sensors is not None:
                sensors.measure(alive, x, seen)
            if self._pushed:
                self._end_pushes()
            state.tick(seen)
            if drive(alive, plants, torque, x, now, k, rows, tau):
                self._find_ends(self.row)
            for live, place in kept:
                place[k] = live
            move(plants, forces, k)
            self.row += 1
            if arrive(alive, plants, x, references, (k + 1) % BLOCK_ROWS, seen):
                self._find_ends(self.row)
        self.torque = rows[2, k]

    def _prepare_flight(self, names: list[str]) -> tuple[Any, ...] | None:
        """Return what a flight needs and keeps; None where law or motion is not all kernels."""
        law = getattr(self._state, "flight", None)
        if law is None or not isinstance(self._motion, CompiledEuler):
            return None
        from fpid_pin.kernels.flight import fly
        from fpid_pin.kernels.sensors import SENSOR

        runs, n = self.q.shape
        kept = np.zeros((len(KEPT), BLOCK_ROWS, runs, n) if names else (0, 0, 0, 0))
        values = np.zeros((BLOCK_ROWS, runs) if names else (0, 0))
        for name in names:
            self._kept[name] = values if name == "lyapunov" else kept[KEPT.index(name)]
        perfect = np.zeros((1, 1), SENSOR), np.zeros((1, 2, 1, 1)), np.zeros((0, 2, 1, 1)), 0
        return fly, law, perfect, kept, values, np.zeros(runs, dtype=np.int64)

    def _fly(self, first: int, count: int, forces: FloatArray) -> None:
        """Make ticks of this block in one call."""
        assert self._flight is not None
        assert isinstance(self._motion, CompiledEuler)
        fly, law, perfect, kept, values, ends = self._flight
        sensors = self._sensors
        senses = perfect if sensors is None else sensors.flight(count)
        fly(
            self._alive, *law, *self._motion.records, self._plants, self._x, self._seen,
            self._state.torque, self._motion.tau, self._motion.a, self._references.values, forces,
            self._rows, sensors is not None, *senses, kept.size > 0, kept, values, first, count,
            ends,
        )  # fmt: skip
        row, self.row = self.row, self.row + count
        self.torque = self._rows[2, first + count - 1]
        for end in sorted(set(ends.tolist()) - {-1}):
            self._find_ends(row + end - first, ends == end)

    def block(self) -> Block:
        """Return the rows since the last block, at most `BLOCK_ROWS`; views of live buffers."""
        first, size = self._block_row, self.row - self._block_row
        self._block_row = self.row
        table, group = self._references.values, self._references.group
        part = table[:2, :size] if table.shape[2] == 1 else table[:2, :size, group]
        q_ref, v_ref = np.broadcast_to(part, (2, size, len(group), table.shape[-1]))
        t: FloatArray = np.arange(first, self.row, dtype=np.float64) * self.step
        valid = np.clip(self._last - first, 0, size)
        kept = {name: values[:size] for name, values in self._kept.items()}
        q, v, torque = self._rows[:, :size]
        return Block(first, t, q_ref, v_ref, q, v, torque, valid, kept)

    def _sample(self) -> None:
        """Sample the references and disturbances of the next block."""
        t: FloatArray = np.arange(self.row, self.row + BLOCK_ROWS, dtype=np.float64) * self.step
        self._references.sample([t])
        self._forces.sample([t + part * self.step for part in self._motion.offsets])

    def _end_pushes(self) -> None:
        over = self._push_ends <= self.row
        self._plants["push"][over] = 0.0
        self._pushed = not over.all()

    def _find_ends(self, row: int, among: BoolArray | None = None) -> None:
        """End the runs whose state of this row, or whose torque, does not count any more."""
        torque, limit = self._state.torque, self._plants["runaway"]
        slow = np.abs(self.v) <= limit
        sound = slow & np.isfinite(self.q) & np.isfinite(torque)
        lost = self._alive & ~sound.all(axis=1)
        for run in np.flatnonzero(lost if among is None else lost & among).tolist():
            joint = int(np.argmin(sound[run]))
            speed = self.v[run, joint]
            if not np.isfinite(speed):
                cause = "speed is not finite"
            elif not slow[run, joint]:
                cause = f"speed {abs(speed):.3g} rad/s is beyond {limit[run, joint]:g} rad/s"
            elif not np.isfinite(torque[run, joint]):
                cause = "torque is not finite"
            else:
                cause = "angle is not finite"
            self._end(run, row, self._experiments[run].arm.joint_names[joint], cause)

    def _end(self, run: int, row: int, joint: str, cause: str) -> None:
        self.ends[run] = Outcome(False, row * self.step, joint, cause)
        self._last[run] = row
        self._state.retire(run)
        self._motion.retire(run)
        for name in ("viscous", "push"):
            self._plants[name][run] = 0.0
        for array in (self.q, self.v, self._motion.tau):
            array[run] = 0.0
        self._seen[:, run] = 0.0


class _Table:
    """Samples, (parts, K, groups, n), of what runs are given from outside; `group` of each run.

    What several runs share is sampled once.
    """

    def __init__(
        self, sources: Sequence[tuple[object, Callable[[FloatArray], Sequence[FloatArray]]]],
        parts: int, n: int,
    ) -> None:  # fmt: skip
        # Objects are told apart by identity; keep them alive so that no identity is reused.
        self._keys = [key for key, _ in sources]
        groups = {id(key): (k, sample) for k, (key, sample) in enumerate(sources)}
        self._samplers = [sample for _, sample in groups.values()]
        places = {key: place for place, key in enumerate(groups)}
        self.group: NDArray[np.int64] = np.array([places[id(key)] for key, _ in sources])
        self.values: FloatArray = np.zeros((parts, BLOCK_ROWS, len(groups), n))

    def sample(self, times: Sequence[FloatArray]) -> None:
        """Sample at `times`, one (K,) for each part, or one for all that a sampler returns."""
        for place, sampler in enumerate(self._samplers):
            found = sampler(times[0]) if len(times) == 1 else [sampler(t)[0] for t in times]
            for part, values in zip(self.values, found, strict=True):
                part[:, place] = values


def _sampler(plant: ResolvedPlant, n: int) -> Callable[[FloatArray], Sequence[FloatArray]]:
    d = plant.disturbance
    return lambda t: (np.zeros((len(t), n)) if d is None else d.sample(t),)
