"""A run for other programs: pandas, CSV, MATLAB, Parquet."""

from __future__ import annotations

import csv
import json
import re
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from fpid_pin.checks import FloatArray
from fpid_pin.exceptions import ArgumentError
from fpid_pin.extras import needed
from fpid_pin.files import replacing
from fpid_pin.simulation.run_file import KINEMATICS
from fpid_pin.simulation.run_table import to_json

if TYPE_CHECKING:
    from fpid_pin.simulation.run import Run

#: MATLAB knows no longer names.
_LONGEST = 63


def columns(run: Run) -> dict[str, FloatArray]:
    """Return every number of a run by column: ``t``, ``q.joint1``, ..., ``kp.joint1``, ..."""
    names = run.arm.joint_names
    arrays = {"t": run.t} | {name: getattr(run, name) for name in KINEMATICS}
    taken = sorted(run.signals.keys() & arrays.keys())
    if taken:
        raise ArgumentError("signals", f"other names than {', '.join(arrays)}", taken[0])
    found = {}
    for name, array in (arrays | dict(run.signals)).items():
        if array.ndim == 1:
            found[name] = array
        else:
            found |= {f"{name}.{joint}": array[:, j] for j, joint in enumerate(names)}
    return found


def units(run: Run) -> dict[str, str]:
    """Return the units of columns; what a law's signals are measured in is the law's to say."""
    arm, found = run.arm, {"t": "s"}
    for j, joint in enumerate(arm.joint_names):
        found |= {f"{name}.{joint}": arm.units[j] for name in ("q", "q_ref")}
        found |= {f"{name}.{joint}": f"{arm.units[j]}/s" for name in ("v", "v_ref")}
        found[f"torque.{joint}"] = arm.effort_units[j]
    return found


def about(run: Run) -> dict[str, Any]:
    """Return what goes with the columns: name, step, outcome, units, and the record's table."""
    return {
        "name": run.name,
        "step": run.step,
        "outcome": str(run.outcome),
        "units": units(run),
        "meta": json.loads(to_json(run.meta)),
    }


def to_dataframe(run: Run) -> Any:
    """See `Run.to_dataframe`."""
    frame = needed("pandas", "pandas").DataFrame(columns(run))
    frame.attrs.update(about(run))
    return frame


def to_csv(run: Run, path: Path) -> None:
    """See `Run.to_csv`."""
    table = columns(run)
    rows = zip(*(column.tolist() for column in table.values()), strict=True)
    with replacing(path) as temporary, open(temporary, "w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(table)
        writer.writerows(rows)


def to_mat(run: Run, path: Path) -> None:
    """See `Run.to_mat`."""
    from scipy.io import savemat

    content = {"t": run.t} | {name: getattr(run, name) for name in KINEMATICS}
    told = about(run)
    content |= {
        "signals": _struct(run.signals),
        "joint_names": np.array(run.arm.joint_names, dtype=object),
        **{name: told[name] for name in ("name", "step", "outcome")},
        "meta": json.dumps(told["meta"]),
    }
    with replacing(path) as temporary, open(temporary, "wb") as file:
        savemat(file, content, long_field_names=True, do_compression=True, oned_as="column")


def _struct(signals: Any) -> dict[str, FloatArray]:
    """Return signals under names that MATLAB takes for fields."""
    found: dict[str, FloatArray] = {}
    for name, array in signals.items():
        field = re.sub(r"\W", "_", name, flags=re.ASCII)[:_LONGEST]
        field = field if field[:1].isalpha() else f"s{field}"[:_LONGEST]
        if field in found:
            raise ArgumentError("signals", f"one that becomes {field} in MATLAB", name)
        found[field] = array
    return found


def to_parquet(run: Run, path: Path) -> None:
    """See `Run.to_parquet`."""
    arrow = needed("pyarrow", "parquet")
    parquet = needed("pyarrow.parquet", "parquet")
    table = arrow.table(columns(run))
    table = table.replace_schema_metadata({"fpid_pin": json.dumps(about(run))})
    with replacing(path) as temporary:
        parquet.write_table(table, temporary, compression="zstd")
