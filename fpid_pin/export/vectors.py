"""Test vectors: what a controller is given, tick by tick, and the torques that it answers with."""

from __future__ import annotations

import dataclasses
import struct
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ExportError
from fpid_pin.simulation import Experiment, simulate

if TYPE_CHECKING:
    from fpid_pin.arms import Arm
    from fpid_pin.control import Controller

_MAGIC = b"FPIDVEC1"
_SEED = 12


class Vectors(NamedTuple):
    """Inputs, (ticks, 5, n): q, v and q, v, a of the reference; and torques, (ticks, n) [N m]."""

    inputs: FloatArray
    torque: FloatArray

    def write(self, path: Path) -> None:
        """Write them: magic, n and ticks as int32, then each tick's numbers, little-endian."""
        ticks, n = self.torque.shape
        rows = np.concatenate([self.inputs.reshape(ticks, -1), self.torque], axis=1)
        path.write_bytes(_MAGIC + struct.pack("<ii", n, ticks) + rows.astype("<f8").tobytes())


def signals(arm: Arm, step: float, ticks: int) -> FloatArray:
    """Return what a controller may be given, (ticks, 5, n): motions within the joints' limits.

    The errors come and go, from none to half a radian, so that whatever acts on small and on large
    ones is seen doing so; a little noise is measured with them.
    """
    rng = np.random.default_rng(_SEED)
    t = step * np.arange(ticks)[:, np.newaxis]
    span = np.minimum(np.where(np.isfinite(arm.upper - arm.lower), arm.upper - arm.lower, 4.0), 4.0)

    def motion(size: FloatArray, low: float, high: float) -> list[FloatArray]:
        """Return a sum of three sinusoids and its two derivatives, (ticks, n)."""
        total = np.zeros((3, ticks, arm.n))
        for _ in range(3):
            w, phase = rng.uniform(low, high, arm.n), rng.uniform(0.0, 6.28, arm.n)
            s, c = size / 3.0 * np.sin(w * t + phase), size / 3.0 * np.cos(w * t + phase)
            total += np.stack([s, w * c, -w * w * s])
        return list(total)

    q_ref, v_ref, a_ref = motion(0.25 * span, 0.3, 3.0)
    e, e_dot, _ = motion(np.full(arm.n, 0.5), 0.5, 9.0)
    gate, fade = 0.5 - 0.5 * np.cos(2.0 * t), np.sin(2.0 * t)
    error, rate = gate * e, gate * e_dot + fade * e
    noise = rng.normal(scale=1e-4, size=(2, ticks, arm.n))
    q, v = arm.home + q_ref - error + noise[0], v_ref - rate + 10.0 * noise[1]
    return np.stack([q, v, arm.home + q_ref, v_ref, a_ref], axis=1)


def simulated(experiment: Experiment, controller: Controller, ticks: int) -> FloatArray:
    """Return what a controller is given in an experiment, (ticks, 5, n).

    Raises
    ------
    ExportError
        The run does not last so long.
    """
    duration = min(ticks * experiment.step, experiment.duration)
    run = simulate(dataclasses.replace(experiment, duration=duration), controller)
    if not run.outcome.completed:
        raise ExportError(f"experiment: expected a run to make vectors of, got one {run.outcome}")
    a_ref = np.broadcast_to(experiment.reference.sample(run.t)[2], run.q.shape)
    return np.stack([run.q, run.v, run.q_ref, run.v_ref, a_ref], axis=1)


def answers(
    controller: Controller, arm: Arm, step: float, horizon: float, inputs: FloatArray
) -> Vectors:
    """Return `inputs` with the torques of the controller as it runs here."""
    loop = controller.start(arm, step=step, horizon=horizon)
    torque = np.array([loop.torque(*row) for row in inputs])
    return Vectors(inputs, torque)
