"""References through points: at given times, by a spline, or as they were recorded."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Array, Check, FloatArray, OneOf
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references.reference import Motion

#: A recording whose step is this many times the median has lost something.
GAP = 10.0
#: Characters of a file's path in a message that goes on with the line.
_PATH = 40


def _check_rows(name: str, value: ArrayLike) -> FloatArray:
    """Check positions, (K, n); an error names the first row of another length."""
    sizes = [int(np.size(row)) for row in value] if isinstance(value, (list, tuple)) else [0]
    odd = next((k for k, size in enumerate(sizes) if size != sizes[0]), None)
    if odd is not None:
        expected = f"{sizes[0]} angles, as in the first row"
        raise ArgumentError(f"{name}.{odd}", expected, f"{sizes[odd]}")
    return checks.floats(name, value, shape=(None, None))


@dataclass(frozen=True, eq=False)
class _Points(Description):
    """Points in time, (K,), and in space, (K, n); their spline holds beyond them, at rest."""

    times: Annotated[ArrayLike, Array("s", shape=(None,))]
    positions: Annotated[ArrayLike, Check(_check_rows, "rad")]

    def __post_init__(self) -> None:
        super().__post_init__()
        t, q = np.asarray(self.times), np.asarray(self.positions)
        if len(t) < 2:
            raise ArgumentError("reference.times", "at least two times", f"shape {t.shape}")
        if len(q) != len(t):
            expected = f"shape ({len(t)}, n), a row for each time"
            raise ArgumentError("reference.positions", expected, f"shape {q.shape}")
        backward = np.flatnonzero(np.diff(t) <= 0.0)
        if backward.size:
            k = int(backward[0]) + 1
            expected = f"a time after the one before ({t[k - 1]:g} s)"
            raise ArgumentError(f"reference.times.{k}", expected, f"{t[k]:g} s")

    def _spline(self) -> Any:
        raise NotImplementedError

    @cached_property
    def _splines(self) -> tuple[Any, Any, Any]:
        spline = self._spline()
        return spline, spline.derivative(1), spline.derivative(2)

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        first, last = np.asarray(self.times)[[0, -1]]
        inside = np.clip(t, first, last)
        q, v, a = (np.array(spline(inside), dtype=np.float64) for spline in self._splines)
        # A sample may fall a rounding error beside the instant it stands for.
        slack = 1e-9
        outside = (t < first - slack) | (t > last + slack)
        v[outside] = a[outside] = 0.0
        return q, v, a


@described("waypoints", "Reference")
@dataclass(frozen=True, eq=False)
class Waypoints(_Points):
    """Through poses at given times, at rest at both ends, by a spline of scipy.

    Parameters
    ----------
    times
        [s], (K,), increasing; before the first and after the last it holds.
    positions
        [rad], (K, n).
    method
        ``"cubic"``: continuous acceleration inside, a jump of it at the ends; ``"quintic"``:
        continuous jerk inside and no acceleration at the ends.

    Raises
    ------
    ArgumentError
        Times that do not increase, fewer than two points, rows of other lengths.
    """

    method: Annotated[str, OneOf("cubic", "quintic")] = "cubic"

    def _spline(self) -> Any:
        # Imported here: scipy.interpolate would be a third of the package's import time.
        from scipy.interpolate import CubicSpline, make_interp_spline

        if self.method == "cubic":
            return CubicSpline(self.times, self.positions, axis=0, bc_type="clamped")
        still = np.zeros(np.shape(self.positions)[1])
        rest = [(1, still), (2, still)]
        return make_interp_spline(self.times, self.positions, k=5, bc_type=(rest, rest))


@described("recorded", "Reference")
@dataclass(frozen=True, eq=False)
class RecordedMotion(_Points):
    """A recorded motion of the joints, repeated through a cubic spline.

    In a configuration ``path`` names a CSV file, as for `from_csv`. A saved run holds the motion
    itself, so it needs no file.

    Parameters
    ----------
    times
        [s], (K,), increasing, without gaps; before the first and after the last it holds.
    positions
        [rad], (K, n).

    Raises
    ------
    ArgumentError
        Times that do not increase; a step more than ten times the median (a gap).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        times = np.asarray(self.times)
        steps = np.diff(times)
        widest = int(np.argmax(steps))
        if steps[widest] > GAP * np.median(steps):
            raise ArgumentError(
                f"reference.times.{widest + 1}",
                f"a step like the others ({np.median(steps):.3g} s)",
                f"a gap of {steps[widest]:.3g} s after t = {times[widest]:g} s",
            )

    def _spline(self) -> Any:
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, self.positions, axis=0)

    @classmethod
    def from_csv(cls, path: str | Path) -> RecordedMotion:
        """Read ``t, q_1, ..., q_n`` ([s], [rad]), a row a sample; a first row of names is skipped.

        Raises
        ------
        ArgumentError
            A file that is missing; a line with an empty or unreadable cell, or with more or fewer
            cells than the first; what the constructor refuses.
        """
        table = np.array(_read_csv(Path(path)))
        if table.ndim != 2 or table.shape[1] < 2:
            raise ArgumentError(f"{path}", "columns t, q_1, ..., q_n", "fewer than two columns")
        return cls(table[:, 0], table[:, 1:])

    @classmethod
    def from_table(cls, fields: Mapping[str, Any]) -> RecordedMotion:
        """Build from a configuration's table, with ``path``, or from a saved run's."""
        allowed = ("path", "times", "positions")
        for key in fields:
            checks.choice(f"reference.{key}", key, allowed)
        if "path" in fields:
            if len(fields) > 1:
                raise ArgumentError("reference", "path alone", "path and " + str(sorted(fields)))
            checks.instance("reference.path", fields["path"], str, "a text")
            return cls.from_csv(fields["path"])
        for key in allowed[1:]:
            if key not in fields:
                raise ArgumentError(f"reference.{key}", "a value (or path, a CSV file)", "none")
        return cls(fields["times"], fields["positions"])


def _read_csv(path: Path) -> list[list[float]]:
    """Read the numbers of a CSV file; an error names the line."""
    if not path.is_file():
        # Nor a device, which may have no end.
        got = "something that is no file" if path.exists() else "no such file"
        raise ArgumentError(f"{path}", "a CSV file", got)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = [(k, row) for k, row in enumerate(csv.reader(file), start=1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error):
        raise ArgumentError(f"{path}", "a CSV file", "something that is not text") from None
    # The file's own name: the line and the column after it are not to be cut off.
    name = str(path) if len(str(path)) <= _PATH else f"...{str(path)[-_PATH:]}"
    if lines and all(_number(cell) is None for cell in lines[0][1]):
        del lines[0]
    rows: list[list[float]] = []
    for line, cells in lines:
        width = len(lines[0][1])
        if len(cells) != width:
            raise ArgumentError(f"{name}, line {line}", f"{width} cells", f"{len(cells)}")
        rows.append([])
        for column, cell in enumerate(cells, start=1):
            value = _number(cell)
            if value is None:
                got = repr(cell) if cell.strip() else "an empty cell"
                raise ArgumentError(f"{name}, line {line}, column {column}", "a number", got)
            rows[-1].append(value)
    if len(rows) < 2:
        raise ArgumentError(f"{path}", "at least two rows of numbers", f"{len(rows)}")
    return rows


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
