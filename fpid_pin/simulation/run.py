"""A recorded run: its arrays, how it ended, what is known of it; as a file, as a table."""

import dataclasses
import json
from collections.abc import Callable, Mapping
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Self, TypeVar, cast

from numpy.typing import ArrayLike

from fpid_pin import checks, descriptions, npz
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray, checked
from fpid_pin.control.law import Controller
from fpid_pin.control.loop import Record
from fpid_pin.costs import MOTION, Metrics, tool_distance
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.resources import needed
from fpid_pin.simulation.experiment import Experiment, Outcome
from fpid_pin.simulation.recorded import SIGNAL, meta_of, metrics_of, on_a_clock
from fpid_pin.text import html_table, shown

KIND = "run file"

T = TypeVar("T")


@lru_cache(maxsize=64)
def _arm_of(table: str) -> Arm:
    # Runs of one arm share it: to build one takes some 20 ms.
    return descriptions.from_dict(json.loads(table), Arm, "arm")


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
        table = self.meta[name]
        try:
            if name == "arm":
                return cast("T", _arm_of(json.dumps(table)))
            if table.get("arm") == self.meta["arm"]:
                table = table | {"arm": self.arm}
            return descriptions.from_dict(table, family, name)
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

    @checked
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
        own = {"outcome": dataclasses.asdict(self.outcome), "step": self.step}
        table = dict(self.meta) | own | {"planned_rows": self.planned_rows}
        path = Path(path)
        if path.suffix != ".npz":
            path = path.with_name(path.name + ".npz")
        npz.write(path, KIND, table, self._arrays(), compressed=compressed)
        return path

    def _arrays(self) -> dict[str, FloatArray]:
        """Return all arrays by the names that they have in a file."""
        own = {name: getattr(self, name) for name in ("t", *MOTION)}
        return own | {f"{SIGNAL}{name}": array for name, array in self.signals.items()}

    @classmethod
    def _of(cls, arrays: Mapping[str, Any], **about: Any) -> Self:
        """Make a run of its arrays by the names that they have in a file."""
        signals = {n.removeprefix(SIGNAL): a for n, a in arrays.items() if n.startswith(SIGNAL)}
        return cls(**{name: arrays[name] for name in ("t", *MOTION)}, signals=signals, **about)

    @classmethod
    @checked
    def load(cls, path: str | Path) -> Self:
        """Read a run; nothing in the file is executed.

        Raises
        ------
        FileFormatError
            Missing, damaged, of another format, or not a run.
        FpidError
            It is compressed, and pcodec is not installed.
        """
        arrays, meta = npz.read(path, KIND)
        own = {name: meta.pop(name) for name in ("step", "planned_rows")}
        return cls._of(arrays, outcome=Outcome(**meta.pop("outcome")), **own, meta=meta)

    @checked
    def thinned(self, every: int) -> Self:
        """Return the run with one row in `every`, the first among them.

        Its step is as many times longer, and its metrics are those of the rows that are left:
        integrals and root mean squares hold as far as these stand for the others, a total variation
        or a peak between them is lost. ``meta["every"]`` says so.

        Raises
        ------
        ArgumentError
            Not a whole number from 1 on, or a step of more than 10 s.
        """
        checks.integer("every", every, low=1)
        step = self.step * every
        if step > checks.STEPS[1]:
            raise ArgumentError("every", f"rows at most {checks.STEPS[1]:g} s apart", f"{step:g} s")
        return self._of(
            {name: array[::every].copy() for name, array in self._arrays().items()},
            outcome=self.outcome, step=step, planned_rows=-(-self.planned_rows // every),
            meta=dict(self.meta) | {"every": every * int(self.meta.get("every", 1))},
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the arrays by name, signals among them, and what is known of the run.

        The latter are ``joint_names``, ``name``, ``step``, ``outcome``, and ``meta`` as JSON: what
        `scipy.io.savemat` and its like take (docs/data.md).
        """
        about = self._about() | {"joint_names": list(self.arm.joint_names)}
        del about["units"]
        return self._shown() | about | {"meta": json.dumps(about["meta"])}

    def to_dataframe(self) -> Any:
        """Return a `pandas.DataFrame` with a column for each number of a row.

        They are ``t``, ``q.<joint>`` and so on, then the law's signals; ``attrs`` has units, name,
        step, outcome and the record's table.

        Raises
        ------
        FpidError
            pandas is not installed; the line says how.
        """
        frame = needed("pandas", "pandas").DataFrame(self.columns())
        frame.attrs.update(self._about())
        return frame

    @checked
    def to_csv(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as CSV, every digit; no pandas is needed."""
        return npz.write_columns(path, self.columns())

    @checked
    def to_parquet(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as Parquet; the schema's metadata has the rest.

        Raises
        ------
        FpidError
            pyarrow is not installed; the line says how.
        """
        return npz.write_columns(path, self.columns(), parquet=True, about=self._about())

    def columns(self) -> dict[str, FloatArray]:
        """Return every number by column: ``t``, ``q.joint1``, ..., ``kp.joint1``, ...

        Raises
        ------
        ArgumentError
            A signal that is called as an array of the motion.
        """
        found = {}
        for name, array in self._shown().items():
            if array.ndim == 1:
                found[name] = array
            else:
                heads = [f"{name}.{joint}" for joint in self.arm.joint_names]
                found |= zip(heads, array.T, strict=True)
        return found

    def _shown(self) -> dict[str, FloatArray]:
        """Return all arrays by the names that they have for other programs."""
        own = ("t", *MOTION)
        if taken := sorted(self.signals.keys() & {*own}):
            raise ArgumentError("signals", f"other names than {', '.join(own)}", taken[0])
        return {name.removeprefix(SIGNAL): array for name, array in self._arrays().items()}

    def _about(self) -> dict[str, Any]:
        """Return what goes with the columns; a signal's unit is the law's to say."""
        arm, units = self.arm, {"t": "s"}
        for joint, unit, effort in zip(arm.joint_names, arm.units, arm.effort_units, strict=True):
            each = {"q": unit, "q_ref": unit, "v": f"{unit}/s", "v_ref": f"{unit}/s",
                    "torque": effort}  # fmt: skip
            units |= {f"{name}.{joint}": unit for name, unit in each.items()}
        outcome, meta = str(self.outcome), dict(self.meta)
        return {
            "name": self.name, "step": self.step, "outcome": outcome, "units": units, "meta": meta,
        }  # fmt: skip

    def _repr_html_(self) -> str:
        """Return the metrics as a table, a row a joint; errors in thousandths of its unit."""
        m, n = self.metrics, len(self.metrics.rms)
        try:
            arm = self.arm
            names, pairs = arm.joint_names, zip(arm.units, arm.effort_units, strict=True)
            inside = [f"m{unit}, {effort}" for unit, effort in pairs]
        except FpidError:  # of another version, say
            names, inside = tuple(f"joint {j + 1}" for j in range(n)), ["?"] * n
        columns = {
            "joint": names, "in": inside, "RMS": 1e3 * m.rms, "tail": 1e3 * m.rms_tail,
            "peak error": 1e3 * m.peak_error, "settled after [s]": m.settling_time,
            "peak torque": m.peak_torque, "at its limit [%]": 100.0 * m.saturated,
        }  # fmt: skip
        rows = zip(*columns.values(), strict=True)
        return html_table(f"{self.name}: {self.outcome}", [*columns], rows)

    @classmethod
    @checked
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
    ) -> Self:
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
        given = {"t": t, "q": q, "q_ref": q_ref, "torque": torque, "v": v, "v_ref": v_ref}
        given |= {f"{SIGNAL}{key}": value for key, value in (signals or {}).items()}
        step, arrays = on_a_clock(given, arm.n, resample)
        time = arrays["t"]
        return cls._of(
            arrays, outcome=Outcome(True, float(time[-1])), step=step, planned_rows=len(time),
            meta=meta_of(name, arm, controller, arm.effort_limit),
        )  # fmt: skip

    @classmethod
    @checked
    def from_record(cls, record: Record, name: str = "recorded") -> Self:
        """Make a run of what a loop has recorded (`Loop.record`)."""
        about: dict[str, Any] = record.arrays() | {"signals": record.signals()}
        return cls.from_arrays(**about, arm=record.arm, controller=record.controller, name=name)
