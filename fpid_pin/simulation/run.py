"""A recorded run: its arrays, how it ended, and its one file."""

from __future__ import annotations

import dataclasses
import platform
import zipfile
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from fpid_pin import descriptions
from fpid_pin._version import __version__
from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.control.controller import Controller
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import ArgumentError, FileFormatError, FpidError
from fpid_pin.files import replacing
from fpid_pin.simulation.experiment import Experiment
from fpid_pin.simulation.metrics import metrics_of
from fpid_pin.simulation.recorders import Outcome
from fpid_pin.simulation.run_table import from_json, to_json

FORMAT = 1
_KINEMATICS = ("q", "v", "q_ref", "v_ref", "torque")


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
        return descriptions.from_dict(self.meta["arm"], Arm, "arm")

    @cached_property
    def controller(self) -> Controller:
        """The controller's description, rebuilt from the record."""
        return descriptions.from_dict(self.meta["controller"], Controller, "controller")

    @cached_property
    def experiment(self) -> Experiment:
        """The experiment, rebuilt from the record."""
        return descriptions.from_dict(self.meta["experiment"], Experiment, "experiment")

    def __getattr__(self, name: str) -> FloatArray:
        signals = self.__dict__.get("signals", {})
        if name in signals:
            array: FloatArray = signals[name]
            return array
        raise AttributeError(f"a run of this controller has no {name!r}; it has {sorted(signals)}")

    def save(self, path: str | Path) -> Path:
        """Write the run as one ``.npz``: arrays and a JSON text, nothing pickled.

        The file appears whole or not at all.
        """
        arrays = {"t": self.t} | {name: getattr(self, name) for name in _KINEMATICS}
        arrays |= {f"signal_{name}": array for name, array in self.signals.items()}
        meta = dict(self.meta) | {
            "outcome": dataclasses.asdict(self.outcome),
            "step": self.step,
            "planned_rows": self.planned_rows,
        }
        path = Path(path)
        if path.suffix != ".npz":
            path = path.with_name(path.name + ".npz")
        text = np.array(to_json(meta))
        with replacing(path) as temporary, open(temporary, "wb") as file:
            np.savez(file, meta=text, **arrays)
        return path

    @classmethod
    def load(cls, path: str | Path) -> Run:
        """Read a run; nothing in the file is executed.

        Raises
        ------
        FileFormatError
            Missing, cut short, altered, of another format, or not a run.
        """
        path = Path(path)
        try:
            # Opened here: np.load leaves a file that it cannot read open.
            with open(path, "rb") as raw, np.load(raw, allow_pickle=False) as file:
                arrays = {name: file[name] for name in file.files}
            meta = from_json(str(arrays.pop("meta")))
            if not isinstance(meta, dict):
                raise TypeError
        except FileNotFoundError:
            raise FileFormatError(f"{path}: no such file") from None
        except OSError as error:
            raise FileFormatError(f"{path}: {error.strerror or 'cannot be read'}") from None
        except (zipfile.BadZipFile, KeyError, ValueError, TypeError, EOFError, AttributeError):
            raise FileFormatError(
                f"{path}: expected a run file, got something else or one that is cut short"
            ) from None
        if meta.get("format") != FORMAT:
            raise FileFormatError(
                f"{path}: expected run format {FORMAT}, got {meta.get('format')!r}"
            )
        try:
            return cls._from_parts(arrays, meta)
        except (KeyError, TypeError, AttributeError) as error:
            raise FileFormatError(f"{path}: expected a whole run, {error} is missing") from None
        except FpidError as error:
            raise FileFormatError(f"{path}: {error}") from None

    @classmethod
    def _from_parts(cls, arrays: dict[str, FloatArray], meta: dict[str, Any]) -> Run:
        outcome = Outcome(**meta.pop("outcome"))
        step, planned = float(meta.pop("step")), int(meta.pop("planned_rows"))
        rows, n = arrays["q"].shape
        kinematics = {name: arrays.pop(name) for name in _KINEMATICS}
        t = arrays.pop("t")
        for name, array in kinematics.items():
            if array.shape != (rows, n) or array.dtype != np.float64:
                raise ArgumentError(name, f"float64 of shape ({rows}, {n})", f"shape {array.shape}")
        signals = {name.removeprefix("signal_"): array for name, array in arrays.items()}
        for name, array in {"t": t, **signals}.items():
            if array.shape not in ((rows,), (rows, n)) or array.dtype != np.float64:
                raise ArgumentError(name, f"float64 with {rows} rows", f"shape {array.shape}")
        return cls(t, **kinematics, signals=signals, outcome=outcome, step=step,
                   planned_rows=planned, meta=meta)  # fmt: skip


def describe_run(experiment: Experiment, controller: Controller, name: str) -> dict[str, Any]:
    """Return the `Run.meta` of a run about to be recorded."""
    import pinocchio
    import scipy

    return {
        "format": FORMAT,
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
        "experiment": descriptions.to_dict(experiment),
        "controller": descriptions.to_dict(controller),
        "arm": descriptions.to_dict(experiment.arm),
    }
