"""A run as a table: for pandas, CSV, Parquet, SciPy and notebooks."""

from __future__ import annotations

import csv
import json
from abc import abstractmethod
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fpid_pin.arms import Arm
from fpid_pin.checks import FloatArray
from fpid_pin.costs import Metrics
from fpid_pin.exceptions import ArgumentError, FpidError
from fpid_pin.extras import needed
from fpid_pin.files import replacing
from fpid_pin.shown import html_table
from fpid_pin.simulation.blocks import MOTION, Outcome

_HEAD = ("joint", "in", "RMS", "tail", "peak error", "settled after [s]", "peak torque",
         "at its limit [%]")  # fmt: skip


class RunTables:
    """What a `Run` is for other programs; its attributes are documented there."""

    t: FloatArray
    signals: Mapping[str, FloatArray]
    outcome: Outcome
    step: float
    meta: Mapping[str, Any]

    @property
    @abstractmethod
    def name(self) -> str: ...  # noqa: D102

    @property
    @abstractmethod
    def arm(self) -> Arm: ...  # noqa: D102

    @property
    @abstractmethod
    def metrics(self) -> Metrics: ...  # noqa: D102

    def to_dict(self) -> dict[str, Any]:
        """Return the arrays by name, signals among them, and what is known of the run.

        The latter are ``joint_names``, ``name``, ``step``, ``outcome``, and ``meta`` as JSON: what
        `scipy.io.savemat` and its like take (docs/data.md).
        """
        about = self._about()
        del about["units"]
        about |= {"joint_names": list(self.arm.joint_names), "meta": json.dumps(about["meta"])}
        return self._arrays() | about

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

    def to_csv(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as CSV, every digit; no pandas is needed."""
        table = self.columns()
        rows = zip(*(column.tolist() for column in table.values()), strict=True)
        with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as f:
            writer = csv.writer(f, lineterminator="\n")
            writer.writerow(table)
            writer.writerows(rows)
        return Path(path)

    def to_parquet(self, path: str | Path) -> Path:
        """Write the columns of `to_dataframe` as Parquet; the schema's metadata has the rest.

        Raises
        ------
        FpidError
            pyarrow is not installed; the line says how.
        """
        table = needed("pyarrow", "parquet").table(self.columns())
        table = table.replace_schema_metadata({"fpid_pin": json.dumps(self._about())})
        with replacing(path) as temporary:
            needed("pyarrow.parquet", "parquet").write_table(table, temporary, compression="zstd")
        return Path(path)

    def columns(self) -> dict[str, FloatArray]:
        """Return every number by column: ``t``, ``q.joint1``, ..., ``kp.joint1``, ...

        Raises
        ------
        ArgumentError
            A signal that is called as an array of the motion.
        """
        found = {}
        for name, array in self._arrays().items():
            if array.ndim == 1:
                found[name] = array
            else:
                joints = enumerate(self.arm.joint_names)
                found |= {f"{name}.{joint}": array[:, j] for j, joint in joints}
        return found

    def _arrays(self) -> dict[str, FloatArray]:
        own = {name: getattr(self, name) for name in ("t", *MOTION)}
        taken = sorted(self.signals.keys() & own.keys())
        if taken:
            raise ArgumentError("signals", f"other names than {', '.join(own)}", taken[0])
        return own | dict(self.signals)

    def _about(self) -> dict[str, Any]:
        """Return what goes with the columns; a signal's unit is the law's to say."""
        arm, units = self.arm, {"t": "s"}
        for j, joint in enumerate(arm.joint_names):
            units |= {f"{name}.{joint}": arm.units[j] for name in ("q", "q_ref")}
            units |= {f"{name}.{joint}": f"{arm.units[j]}/s" for name in ("v", "v_ref")}
            units[f"torque.{joint}"] = arm.effort_units[j]
        return {
            "name": self.name,
            "step": self.step,
            "outcome": str(self.outcome),
            "units": units,
            "meta": dict(self.meta),
        }

    def _repr_html_(self) -> str:
        """Return the metrics as a table, a row a joint; errors in thousandths of its unit."""
        m, n = self.metrics, len(self.metrics.rms)
        try:
            arm = self.arm
            names, units, efforts = arm.joint_names, arm.units, arm.effort_units
        except FpidError:  # of another version, say
            names, units, efforts = tuple(f"joint {j + 1}" for j in range(n)), ("",) * n, ("",) * n
        errors = 1e3 * m.rms, 1e3 * m.rms_tail, 1e3 * m.peak_error
        columns = (*errors, m.settling_time, m.peak_torque, 100.0 * m.saturated)
        pairs = zip(units, efforts, strict=True)
        inside = [f"m{unit}, {effort}" if unit else "?" for unit, effort in pairs]
        rows = zip(names, inside, *(column.tolist() for column in columns), strict=True)
        return html_table(f"{self.name}: {self.outcome}", _HEAD, rows)
