"""A recorded run: its arrays, how it ended, and its one file."""

from __future__ import annotations

import dataclasses
import platform
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from fpid_pin import checks, descriptions
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.simulation import run_file
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.limits import torque_limit
from fpid_pin.simulation.metrics import metrics_of
from fpid_pin.simulation.recorders import Outcome

T = TypeVar("T")


@dataclasses.dataclass(frozen=True, eq=False)
class Run:
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
        Format, versions, platform, seed, and the tables of experiment, controller and arm.
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

    def __getattr__(self, name: str) -> FloatArray:
        signals = self.__dict__.get("signals", {})
        if name in signals:
            array: FloatArray = signals[name]
            return array
        raise AttributeError(f"a run of this controller has no {name!r}; it has {sorted(signals)}")

    def save(self, path: str | Path, *, compressed: bool = False, every: int = 1) -> Path:
        """Write the run as one ``.npz``: arrays and a JSON text, nothing pickled.

        The file appears whole or not at all, and knows when it is damaged.

        Parameters
        ----------
        path
            Gets ``.npz`` where it has not.
        compressed
            Take some 4 to 6 times fewer bytes, every bit of the numbers kept. NumPy reads such a
            file too, but not at a glance (docs/data.md).
        every
            Keep one row in so many, as `thinned` does.

        Raises
        ------
        ArgumentError
            What `load` would not accept; a signal that is not (N,) or (N, n), for example.
        FileFormatError
            The file cannot be written.
        """
        if every != 1:
            return self.thinned(every).save(path, compressed=compressed)
        arrays = {name: getattr(self, name) for name in ("t", *run_file.KINEMATICS)}
        meta = dict(self.meta) | {
            "outcome": dataclasses.asdict(self.outcome),
            "step": self.step,
            "planned_rows": self.planned_rows,
        }
        path = Path(path)
        if path.suffix != ".npz":
            path = path.with_name(path.name + ".npz")
        run_file.write(path, arrays, self.signals, meta, compressed=compressed)
        return path

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
        arrays = {name: getattr(self, name)[::every].copy() for name in ("t", *run_file.KINEMATICS)}
        return dataclasses.replace(
            self, **arrays, signals={name: a[::every].copy() for name, a in self.signals.items()},
            step=step, planned_rows=-(-self.planned_rows // every),
            meta=dict(self.meta) | {"every": every * int(self.meta.get("every", 1))},
        )  # fmt: skip

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run; nothing in the file is executed.

        Raises
        ------
        FileFormatError
            Missing, cut short, altered, of another format, or not a run.
        """
        arrays, signals, meta = run_file.read(path)
        outcome, step, planned, *_ = (
            meta.pop(name) for name in ("outcome", "step", "planned_rows", "rows", "joints")
        )
        return cls(
            **arrays, signals=signals, outcome=Outcome(**outcome), step=float(step),
            planned_rows=int(planned), meta=meta,
        )  # fmt: skip


def describe_run(experiment: Experiment, controller: Controller, name: str) -> dict[str, Any]:
    """Return the `Run.meta` of a run about to be recorded."""
    import pinocchio
    import scipy

    return {
        "format": run_file.FORMAT,
        "name": name,
        "versions": {
            "fpid_pin": __version__,
            "pin": pinocchio.__version__,
            "numpy": np.__version__,
            "scipy": scipy.__version__,
            "python": platform.python_version(),
        },
        "platform": platform.platform(),
        "seed": experiment.seed,
        "effort_limit": torque_limit(experiment).tolist(),
        "experiment": descriptions.to_dict(experiment),
        "controller": descriptions.to_dict(controller),
        "arm": descriptions.to_dict(experiment.arm),
    }
