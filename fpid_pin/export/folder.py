"""`export_c`: a controller as a folder of C99 that can be built, checked, and put on a robot."""

from __future__ import annotations

import dataclasses
import os
import struct
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control import Controller
from fpid_pin.exceptions import ExportError, FileFormatError
from fpid_pin.export.build import readme
from fpid_pin.export.law import CSource, start
from fpid_pin.files import hidden_folder, kind_of, sync, sync_tree
from fpid_pin.references import Hold
from fpid_pin.simulation import Experiment, simulate
from fpid_pin.simulation.toml import toml_text

if TYPE_CHECKING:
    from fpid_pin.arms import Arm

#: Of test vectors: some hundred megabytes.
MOST_TICKS = 1_000_000
_MAGIC = b"FPIDVEC1"
_SEED = 12


@checked
def export_c(
    controller: Controller,
    arm: Arm,
    step: float,
    folder: str | Path,
    *,
    horizon: float = 3600.0,
    ticks: int = 2000,
    experiment: Experiment | None = None,
    toml: str | None = None,
) -> Path:
    """Write a controller as C99: the kernels that simulate, printed, with a proof that they are.

    Parameters
    ----------
    controller
        Any law by its functions (`Controller`'s first two forms), with whatever it has.
    arm
        The nominal arm: its joints, effort limits, and its model where the law uses it.
    step
        Sampling period [s]; part of the controller.
    folder
        A new folder.
    horizon
        Longest time that it will run [s]; fractional memories are fitted for it.
    ticks
        Length of ``vectors.bin``, at most; a million is the most.
    experiment
        What ``vectors.bin`` is recorded in; None: motions within the joints' limits, and errors
        from none to half a radian, whatever the controller answers.
    toml
        The configuration that made it; None: one is written from `controller` and `arm`.

    Returns
    -------
    Path
        Of the folder, with ``fpid.h``, ``fpid.c``, ``fpid_parameters.c``, ``example.c``,
        ``fpid_check.c``, ``vectors.bin``, ``CMakeLists.txt``, ``README.md`` and
        ``controller.toml``.

    Raises
    ------
    ExportError
        A folder that exists, too many joints, a law in plain Python, or one with a line that has no
        counterpart in C.
    ArgumentError
        A design without modes.
    FileFormatError
        The folder cannot be written.
    """
    path = Path(folder)
    if kind_of(path) is not None:
        raise ExportError(f"{path}: expected a new folder, got one that exists")
    step = checks.sampling_step(step)
    ticks = checks.integer("ticks", ticks, low=1, high=MOST_TICKS)
    controller = controller.on(arm, step=step)
    state = start(controller, arm, step, horizon)
    source = CSource(state)
    ticks = min(ticks, round(horizon / step))
    if experiment is None:
        inputs = signals(arm, step, ticks)
    else:
        inputs = simulated(experiment, controller, ticks)
    proof = answers(controller, arm, step, horizon, inputs)
    if not np.isfinite(proof.torque).all():
        raise ExportError(
            f"{type(controller).__name__}: its torques do not stay finite where they have no "
            "effect: give an experiment to record vectors in"
        )
    if toml is None:
        table = {
            "format": 1, "arm": descriptions.to_dict(arm),
            "reference": descriptions.to_dict(Hold(tuple(arm.home.tolist()))),
            "simulation": {"step": step}, "controller": [descriptions.to_dict(controller)],
        }  # fmt: skip
        toml = f"# Exported with --horizon {horizon:g}.\n{toml_text(table)}"
    try:
        with hidden_folder(path) as hidden:
            temporary = hidden / "new"
            temporary.mkdir()
            source.write(temporary)
            proof.write(temporary / "vectors.bin")
            (temporary / "controller.toml").write_text(toml, encoding="utf-8")
            text = readme(state, temporary, source.exact)
            (temporary / "README.md").write_text(text, encoding="utf-8")
            sync_tree(temporary)
            os.rename(temporary, path)
        sync(path.parent)
    except OSError as error:
        raise FileFormatError(f"{path}: cannot be written ({error.strerror})") from None
    return path


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
    """Return what a controller is given in an experiment, (ticks, 5, n)."""
    duration = min(ticks * experiment.step, experiment.duration)
    run = simulate(dataclasses.replace(experiment, duration=duration), controller)
    if not run.outcome.completed:
        raise ExportError(f"experiment: expected a run to make vectors of, got one {run.outcome}")
    return np.stack([run.q, run.v, *experiment.motion(run.t)], axis=1)


def answers(
    controller: Controller, arm: Arm, step: float, horizon: float, inputs: FloatArray
) -> Vectors:
    """Return `inputs` with the torques of the controller as it runs here."""
    loop = controller.start(arm, step=step, horizon=horizon)
    torque = np.array([loop.torque(*row) for row in inputs])
    return Vectors(inputs, torque)
