"""The one loop: any number of robots, their controllers and plants, in lockstep.

A tick: measure, torque, the drives' limits, record, one step of the motion with the torque held.
States are written straight into the rows that recorders receive, so recording q, q' and the torque
costs nothing extra. Which runs share a call never changes a bit of any of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from fpid_pin.checks import BoolArray, FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.disturbances import Disturbance
from fpid_pin.progress import Progress, ProgressCallback
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.integrators import integrator
from fpid_pin.simulation.metrics import BLOCK_ROWS
from fpid_pin.simulation.plant import plant_of
from fpid_pin.simulation.recorders import ALL_SIGNALS, Batch, Block, Outcome, Recorder
from fpid_pin.simulation.sensors import SensorState


class _Retirable(Protocol):
    def retire(self, run: int) -> None: ...


class _Columns:
    """Samples what runs are given from outside; what several runs share is sampled once."""

    def __init__(
        self, sources: Sequence[tuple[object, Callable[[FloatArray], FloatArray]]]
    ) -> None:
        self._groups: dict[int, tuple[Callable[[FloatArray], FloatArray], list[int]]] = {}
        # Objects are told apart by identity; keep them alive so that no identity is reused.
        self._keys = [key for key, _ in sources]
        for run, (key, sample) in enumerate(sources):
            self._groups.setdefault(id(key), (sample, []))[1].append(run)

    def fill(self, t: FloatArray, out: FloatArray) -> None:
        """Write the samples at `t`, (K,), into `out`, (..., K, runs, n)."""
        for sample, runs in self._groups.values():
            values = sample(t)[..., np.newaxis, :]
            if len(runs) == out.shape[-2]:
                out[...] = values
            else:
                out[..., runs, :] = values


def _references(experiments: Sequence[Experiment]) -> _Columns:
    def sampler(experiment: Experiment) -> Callable[[FloatArray], FloatArray]:
        return lambda t: np.stack(experiment.motion(t))

    return _Columns([(e.reference, sampler(e)) for e in experiments])


def _disturbances(experiments: Sequence[Experiment], n: int) -> _Columns | None:
    plants = [plant_of(e) for e in experiments]
    if all(p.disturbance is None for p in plants):
        return None

    def sampler(d: Disturbance | None) -> Callable[[FloatArray], FloatArray]:
        if d is None:
            return lambda t: np.zeros((len(t), n))
        return lambda t: np.broadcast_to(d.sample(t), (len(t), n))

    return _Columns([(p.disturbance, sampler(p.disturbance)) for p in plants])


def lockstep(
    experiments: Sequence[Experiment],
    controllers: Sequence[Controller],
    recorders: Sequence[Recorder],
    progress: ProgressCallback | None = None,
) -> list[Outcome]:
    """Simulate runs that share arm, step, duration, integrator and kind of controller.

    Parameters
    ----------
    experiments, controllers
        One a run.
    recorders
        What to do with the rows.
    progress
        Called every so many rows.

    Returns
    -------
    list of Outcome
        One a run; a diverged run does not disturb the others.
    """
    first = experiments[0]
    runs, n, rows, h = len(experiments), first.arm.n, first.rows, first.step
    plants = [plant_of(e) for e in experiments]
    state = type(controllers[0]).start_many(
        controllers, first.arm, step=h, horizon=max(first.duration, 2.0 * h)
    )
    motion = integrator(first.integrator, plants, h)
    sensors = None
    if any(e.sensors is not None for e in experiments):
        sensors = SensorState([e.sensors for e in experiments], [e.seed for e in experiments], n, h)
    references, disturbances = _references(experiments), _disturbances(experiments, n)
    limit = np.array([p.effort_limit for p in plants])
    limited = bool(np.isfinite(limit).any())
    runaway = np.array([e.runaway_speed for e in experiments])[:, np.newaxis]

    batch = Batch(experiments, controllers, runs, n, rows, h)
    for recorder in recorders:
        recorder.start(batch)

    k_most = min(BLOCK_ROWS, rows)
    x = np.zeros((k_most + 1, 2, runs, n))
    x[0, 0] = np.array([e.q0 for e in experiments])
    x[0, 1] = np.array([e.v0 for e in experiments])
    ref = np.zeros((3, k_most, runs, n))
    torque = np.zeros((k_most, runs, n))
    offsets = motion.offsets
    force = np.zeros((len(offsets), k_most, runs, n))
    live = state.signals()
    wanted = {name for recorder in recorders for name in recorder.wanted}
    names = list(live) if wanted & set(ALL_SIGNALS) else [name for name in live if name in wanted]
    kept = {name: np.zeros((k_most, *live[name].shape)) for name in names}

    # Views of every row, made once: indexing would cost more than the arithmetic at a few runs.
    q_rows, v_rows = list(x[:, 0]), list(x[:, 1])
    q_refs, v_refs, a_refs = (list(part) for part in ref)
    torques, forces = list(torque), [force[:, k] for k in range(k_most)]
    keep_rows = [list(zip([live[m] for m in names], [kept[m][k] for m in names], strict=True))
                 for k in range(k_most)]  # fmt: skip

    outcomes: list[Outcome | None] = [None] * runs
    alive = np.ones(runs, dtype=bool)
    with np.errstate(all="ignore"):
        for row in range(0, rows, k_most):
            size = min(k_most, rows - row)
            t: FloatArray = np.arange(row, row + size, dtype=np.float64) * h
            references.fill(t, ref[:, :size])
            if disturbances is not None:
                for part, offset in zip(force, offsets, strict=True):
                    disturbances.fill(t + offset * h, part[:size])
            for k in range(size):
                q, v = q_rows[k], v_rows[k]
                measured = (q, v) if sensors is None else sensors.measure(q, v)
                u = state.torque(measured[0], measured[1], q_refs[k], v_refs[k], a_refs[k])
                if limited:
                    np.clip(u, -limit, limit, out=torques[k])
                else:
                    np.copyto(torques[k], u)
                for value, place in keep_rows[k]:
                    np.copyto(place, value)
                if row + k < rows - 1:
                    d = None if disturbances is None else forces[k]
                    motion.advance(q, v, torques[k], d, q_rows[k + 1], v_rows[k + 1])

            block = Block(
                row, t, ref[0, :size], ref[1, :size], x[:size, 0], x[:size, 1], torque[:size],
                np.where(alive, size, 0), {name: kept[name][:size] for name in names},
            )  # fmt: skip
            for run, outcome in _divergences(block, alive, runaway, batch):
                outcomes[run] = outcome
                alive[run] = False
                parts: list[_Retirable | None] = [state, motion, sensors]
                for part_ in parts:
                    if part_ is not None:
                        part_.retire(run)
            for recorder in recorders:
                recorder.take(block)
            x[0] = x[size]
            if not alive.all():
                x[0][:, ~alive] = 0.0
                if not alive.any():
                    break
            if progress is not None:
                progress(Progress((row + size) / rows))
    return [o or Outcome(completed=True, time=(rows - 1) * h) for o in outcomes]


def _divergences(
    block: Block, alive: BoolArray, runaway: FloatArray, batch: Batch
) -> list[tuple[int, Outcome]]:
    """Find the runs that end in this block; cut `block.valid` there."""
    slow = np.abs(block.v) <= runaway
    sound = slow & np.isfinite(block.q) & np.isfinite(block.torque)
    if sound.all():
        return []
    found = []
    ends = alive & ~np.asarray(sound.all(axis=(0, 2)))
    for run in map(int, np.flatnonzero(ends)):
        k, joint = (int(i) for i in np.argwhere(~sound[:, run])[0])
        speed = block.v[k, run, joint]
        if not np.isfinite(speed):
            cause = "speed is not finite"
        elif not slow[k, run, joint]:
            cause = f"speed {abs(speed):.3g} rad/s is beyond {runaway[run, 0]:g} rad/s"
        elif not np.isfinite(block.torque[k, run, joint]):
            cause = "torque is not finite"
        else:
            cause = "angle is not finite"
        name = batch.experiments[run].arm.joint_names[joint]
        block.valid[run] = k
        found.append((run, Outcome(False, float(block.t[k]), name, cause)))
    return found
