"""A recorded run: its arrays, how it ended, what is known of it, and its one file."""

from __future__ import annotations

import dataclasses
import platform
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions, npz
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.loop import Record
from fpid_pin.costs import Metrics, tool_distance
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.simulation.blocks import MOTION, Outcome
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.metrics import metrics_of
from fpid_pin.simulation.run_tables import RunTables
from fpid_pin.text import shown

KIND = "run file"
#: Fraction of a step by which a row's time may be off the grid; it is measured as if on it.
JITTER = 0.1
_SIGNAL = "signal_"

T = TypeVar("T")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Run(RunTables):
    """What one robot did; rows are samples, N of them.

    Attributes
    ----------
    t
        Time [s], (N,).
    q, v, q_ref, v_ref
        Joint angles and rates and their references [rad], [rad/s], (N, n).
    torque
        What the drives gave [N m], (N, n); the last row was not applied.
    signals
        What the controller showed of itself: ``kp``, ``ki``, ``kd``, ``u_fpid``, ``u_s``, ``s``,
        (N, n), ``lyapunov``, (N,); each is an attribute too.
    outcome
        Whether it completed, else when, where and why it ended; it is cut there.
    step
        Sampling period [s].
    planned_rows
        Rows that a completed run has.
    meta
        Versions, platform, seed, and the tables of experiment, controller and arm.
    """

    t: FloatArray
    q: FloatArray
    v: FloatArray
    q_ref: FloatArray
    v_ref: FloatArray
    torque: FloatArray
    signals: Mapping[str, FloatArray]
    outcome: Outcome
    step: float
    planned_rows: int
    meta: Mapping[str, Any]

    def __repr__(self) -> str:
        rows, joints = self.q.shape
        about = f"{joints} joints, {rows} rows, step {self.step:g} s"
        return f"<Run {shown(self.name)}: {about}, {self.outcome}>"

    @property
    def error(self) -> FloatArray:
        """``e = q_d - q`` [rad], (N, n)."""
        return self.q_ref - self.q

    @property
    def name(self) -> str:
        """What tables and figures call it."""
        return str(self.meta.get("name") or self.meta["controller"].get("kind", "run"))

    @cached_property
    def metrics(self) -> Metrics:
        """Figures of merit, (n,) each."""
        return metrics_of(self)

    @cached_property
    def arm(self) -> Arm:
        """The nominal arm, rebuilt from the record."""
        return self._rebuilt("arm", Arm)

    @cached_property
    def controller(self) -> Controller:
        """The controller's description, rebuilt from the record."""
        return self._rebuilt("controller", Controller)

    @cached_property
    def experiment(self) -> Experiment:
        """The experiment, rebuilt from the record."""
        return self._rebuilt("experiment", Experiment)

    def _rebuilt(self, name: str, family: Callable[..., T]) -> T:
        try:
            return descriptions.from_dict(self.meta[name], family, name)
        except FpidError:
            raise
        except Exception as error:
            # A record may come from anybody; what its tables make of the libraries below is theirs.
            kind = type(error).__name__
            raise FileFormatError(f"{name}: expected a description, got {kind}: {error}") from error

    @cached_property
    def tool_error(self) -> FloatArray:
        """How far the tool is from where it should be, by the nominal arm, (N,) [m]."""
        return tool_distance(self.arm, self.q, self.q_ref)

    def __getattr__(self, name: str) -> FloatArray:
        signals = self.__dict__.get("signals", {})
        if name in signals:
            array: FloatArray = signals[name]
            return array
        raise AttributeError(f"a run of this controller has no {name!r}; it has {sorted(signals)}")

    def save(self, path: str | Path, *, compressed: bool = False, every: int = 1) -> Path:
        """Write the run as one ``.npz``: arrays and a JSON table, nothing pickled.

        The file appears whole or not at all, and a damaged one is noticed when it is read.

        Parameters
        ----------
        path
            Gets ``.npz`` where it has not.
        compressed
            Take 2 to 7 times fewer bytes (noise has the most), every bit kept, by pcodec: the
            extra ``fpid_pin[compressed]``.
        every
            Keep one row in so many, as `thinned` does.

        Raises
        ------
        ArgumentError
            A signal that is not (N,) or (N, n), or whose name is none for a file.
        FileFormatError
            The file cannot be written.
        FpidError
            pcodec is not installed; the line says how.
        """
        if every != 1:
            return self.thinned(every).save(path, compressed=compressed)
        rows, n = self.q.shape
        for name, array in self.signals.items():
            if array.shape not in ((rows,), (rows, n)):
                expected = f"a signal with {rows} rows"
                raise ArgumentError(f"signals.{name}", expected, f"shape {array.shape}")
        arrays = {name: getattr(self, name) for name in ("t", *MOTION)}
        arrays |= {f"{_SIGNAL}{name}": array for name, array in self.signals.items()}
        table = dict(self.meta) | {
            "outcome": dataclasses.asdict(self.outcome),
            "step": self.step,
            "planned_rows": self.planned_rows,
        }
        path = Path(path)
        if path.suffix != ".npz":
            path = path.with_name(path.name + ".npz")
        npz.write(path, KIND, table, arrays, compressed=compressed)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run; nothing in the file is executed.

        Raises
        ------
        FileFormatError
            Missing, damaged, of another format, or not a run.
        FpidError
            It is compressed, and pcodec is not installed.
        """
        arrays, meta = npz.read(path, KIND)
        signals = {
            name.removeprefix(_SIGNAL): arrays.pop(name)
            for name in list(arrays)
            if name.startswith(_SIGNAL)
        }
        outcome, step, planned = (meta.pop(name) for name in ("outcome", "step", "planned_rows"))
        return cls(
            **arrays, signals=signals, outcome=Outcome(**outcome), step=step,
            planned_rows=planned, meta=meta,
        )  # fmt: skip

    def thinned(self, every: int) -> Run:
        """Return the run with one row in `every`, the first among them.

        Its step is as many times longer, and its metrics are those of the rows that are left:
        integrals and root mean squares hold as far as these stand for the others, a total variation
        or a peak between them is lost. ``meta["every"]`` says so.

        Raises
        ------
        ArgumentError
            Not a whole number from 1 on, or a step of more than 10 s.
        """
        every = checks.integer("every", every, low=1)
        step = self.step * every
        if step > checks.STEPS[1]:
            raise ArgumentError("every", f"rows at most {checks.STEPS[1]:g} s apart", f"{step:g} s")
        arrays = {name: getattr(self, name)[::every].copy() for name in ("t", *MOTION)}
        return dataclasses.replace(
            self, **arrays, signals={name: a[::every].copy() for name, a in self.signals.items()},
            step=step, planned_rows=-(-self.planned_rows // every),
            meta=dict(self.meta) | {"every": every * int(self.meta.get("every", 1))},
        )  # fmt: skip

    @classmethod
    def from_arrays(
        cls,
        t: ArrayLike,
        q: ArrayLike,
        q_ref: ArrayLike,
        torque: ArrayLike,
        *,
        arm: Arm,
        v: ArrayLike | None = None,
        v_ref: ArrayLike | None = None,
        signals: Mapping[str, ArrayLike] | None = None,
        controller: Controller | None = None,
        name: str = "recorded",
        resample: float | None = None,
    ) -> Run:
        """Make a run of what another simulator or a robot recorded: it is as good as ours.

        Parameters
        ----------
        t
            (N,) [s], with one step throughout; where the first row is 0.
        q, q_ref, torque
            Measured angles, their reference [rad] and the torque from each row to the next [N m],
            (N, n).
        arm
            What it is to be shown and measured as.
        v, v_ref
            Their rates [rad/s]; None: by differences of the angles.
        signals
            Anything else, (N, n) or (N,).
        controller
            The law, where it is one of ours.
        name
            What tables and figures call it.
        resample
            Take the rows at this step instead [s], by straight lines between those given.

        Raises
        ------
        ArgumentError
            Shapes that do not fit; NaN or inf; times that go back, or rows off a uniform step by
            more than a tenth of it while nothing is to be resampled.
        """
        checks.instance("arm", arm, Arm, "an Arm")
        if controller is not None:
            checks.instance("controller", controller, Controller, "a Controller")
        time = _times(t)
        rows, n = len(time), arm.n
        given = {"q": q, "q_ref": q_ref, "torque": torque, "v": v, "v_ref": v_ref}
        arrays = {
            key: _rows(key, value, ((rows, n),))
            for key, value in given.items()
            if value is not None
        }
        own = {
            key: _rows(f"signals.{key}", value, ((rows, n), (rows,)))
            for key, value in (signals or {}).items()
        }
        for rate, angle in (("v", "q"), ("v_ref", "q_ref")):
            if rate not in arrays:
                arrays[rate] = np.gradient(arrays[angle], time, axis=0)
        if resample is None:
            step = _uniform_step(time)
        else:
            step = checks.number("resample", resample, above=0.0)
            rows = checks.sample_count(float(time[-1]), step)
            grid = step * np.arange(rows, dtype=np.float64)
            arrays, own = (
                {key: _interpolated(grid, time, array) for key, array in table.items()}
                for table in (arrays, own)
            )
        return cls(
            step * np.arange(rows, dtype=np.float64), **arrays, signals=own,
            outcome=Outcome(True, step * (rows - 1)), step=step, planned_rows=rows,
            meta=meta_of(name, arm, controller, arm.effort_limit),
        )  # fmt: skip

    @classmethod
    def from_record(cls, record: Record, name: str = "recorded") -> Run:
        """Make a run of what a loop has recorded (`Loop.record`)."""
        own = record.arrays()
        return cls.from_arrays(
            own["t"], own["q"], own["q_ref"], own["torque"], v=own["v"], v_ref=own["v_ref"],
            arm=record.arm, signals=record.signals(), controller=record.controller, name=name,
        )  # fmt: skip


def _times(t: ArrayLike) -> FloatArray:
    """Return times that increase, from 0 on."""
    time = checks.floats("t", t)
    if time.ndim != 1 or len(time) < 2:
        raise ArgumentError("t", "(N,) with at least 2 rows", f"shape {time.shape}")
    backwards = np.flatnonzero(np.diff(time) <= 0.0)
    if backwards.size:
        k = int(backwards[0]) + 1
        raise ArgumentError("t", "times that increase", f"{time[k]:g} s in row {k}")
    return np.asarray(time - time[0])


def _rows(name: str, value: ArrayLike, shapes: tuple[tuple[int, ...], ...]) -> FloatArray:
    array = checks.floats(name, value)
    if array.shape not in shapes:
        expected = f"shape {shapes[0]} (rows, joints)"
        raise ArgumentError(name, expected, f"shape {array.shape}")
    return array.copy()


def _uniform_step(time: FloatArray) -> float:
    step = float(time[-1]) / (len(time) - 1)
    checks.number("t's step", step, low=checks.STEPS[0], high=checks.STEPS[1])
    off = np.abs(time - step * np.arange(len(time)))
    worst = int(np.argmax(off))
    if off[worst] > JITTER * step:
        raise ArgumentError(
            "t", f"a step of {step:g} s throughout (or resample={step:.3g})",
            f"row {worst} off by {off[worst]:.3g} s",
        )  # fmt: skip
    return step


def _interpolated(grid: FloatArray, time: FloatArray, array: FloatArray) -> Any:
    columns = array.reshape(len(time), -1).T
    found = np.stack([np.interp(grid, time, column) for column in columns], axis=1)
    return found.reshape(len(grid), *array.shape[1:])


def describe_run(
    experiment: Experiment, controller: Controller, name: str, dynamics: str
) -> dict[str, Any]:
    """Return the `Run.meta` of a run about to be recorded, with the dynamics that made it."""
    table = descriptions.to_dict(experiment) | {"dynamics": dynamics}
    about = {"seed": experiment.seed, "experiment": table}
    return meta_of(name, experiment.arm, controller, experiment.torque_limit) | about


def meta_of(
    name: str, arm: Arm, controller: Controller | None, effort_limit: FloatArray
) -> dict[str, Any]:
    """Return the `Run.meta` of a run that no experiment of ours has made."""
    import pinocchio
    import scipy

    elsewhere = {"kind": "custom", "repr": "recorded elsewhere"}
    return {
        "name": name,
        "versions": {
            "fpid_pin": __version__,
            "pin": pinocchio.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "platform": platform.platform(),
        "effort_limit": effort_limit.tolist(),
        "experiment": elsewhere,
        "controller": elsewhere if controller is None else descriptions.to_dict(controller),
        "arm": descriptions.to_dict(arm),
    }
