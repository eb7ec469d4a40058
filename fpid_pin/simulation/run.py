"""A recorded run: its arrays, how it ended, and its one file."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, TypeVar

from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.law import Controller
from fpid_pin.control.record import Record
from fpid_pin.costs import Metrics, tool_distance
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.simulation import recorded, run_file, run_shown, run_tables
from fpid_pin.simulation.blocks import Outcome
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.metrics import metrics_of

T = TypeVar("T")


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
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

    def __repr__(self) -> str:
        return run_shown.line(self)

    def _repr_html_(self) -> str:
        return run_shown.html(self)

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
        """Write the run as one ``.npz``: arrays and a JSON text, nothing pickled.

        The file appears whole or not at all, and knows when it is damaged.

        Parameters
        ----------
        path
            Gets ``.npz`` where it has not.
        compressed
            Take 2 to 7 times fewer bytes (noise has the most), every bit of the numbers kept.
            NumPy reads such a file too, but not at a glance (docs/data.md).
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

    # ------------------------------------------------------------------ for other programs

    def to_dataframe(self) -> Any:
        """Return a `pandas.DataFrame` with a column for each number of a row.

        They are ``t``, ``q.<joint>`` and so on, then the law's signals; ``attrs`` has units, name,
        step, outcome and the record's table.

        Raises
        ------
        FpidError
            pandas is not installed; the line says how.
        """
        return run_tables.to_dataframe(self)

    def to_csv(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as CSV, every digit; no pandas is needed."""
        run_tables.to_csv(self, Path(path))
        return Path(path)

    def to_mat(self, path: str | Path) -> Path:
        """Write a MATLAB file (version 5): the arrays, ``signals.kp`` and so on, ``joint_names``.

        ``meta`` is the record's table as JSON, for ``jsondecode``.
        """
        run_tables.to_mat(self, Path(path))
        return Path(path)

    def to_parquet(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as Parquet; the schema's metadata has the rest.

        Raises
        ------
        FpidError
            pyarrow is not installed; the line says how.
        """
        run_tables.to_parquet(self, Path(path))
        return Path(path)

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
        arguments = recorded.run_arguments(
            t, q, q_ref, torque, arm=arm, v=v, v_ref=v_ref, signals=signals,
            controller=controller, name=name, resample=resample,
        )  # fmt: skip
        return cls(**arguments)

    @classmethod
    def from_record(cls, record: Record, name: str = "recorded") -> Run:
        """Make a run of what a loop has recorded (`Loop.record`)."""
        own = record.arrays()
        return cls.from_arrays(
            own["t"], own["q"], own["q_ref"], own["torque"], v=own["v"], v_ref=own["v_ref"],
            arm=record.arm, signals=record.signals(), controller=record.controller, name=name,
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
