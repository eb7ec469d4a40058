"""A motion that was recorded, from a CSV file or an array."""

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
from fpid_pin.checks import Array, FloatArray
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.references.reference import Motion
from fpid_pin.references.splines import Rows, Splines, check_points, held, with_derivatives

#: Characters of a file's path in a message that goes on with the line.
_PATH = 40

#: A recording whose step is this many times the median has lost something.
GAP = 10.0


@described("recorded", "Reference")
@dataclass(frozen=True, eq=False)
class RecordedMotion(Description):
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

    times: Annotated[ArrayLike, Array("s", shape=(None,))]
    positions: Annotated[ArrayLike, Rows("rad")]

    def __post_init__(self) -> None:
        super().__post_init__()
        times = np.asarray(self.times)
        check_points(times, np.asarray(self.positions))
        steps = np.diff(times)
        widest = int(np.argmax(steps))
        if steps[widest] > GAP * np.median(steps):
            raise ArgumentError(
                f"reference.times.{widest + 1}",
                f"a step like the others ({np.median(steps):.3g} s)",
                f"a gap of {steps[widest]:.3g} s after t = {times[widest]:g} s",
            )

    @cached_property
    def _splines(self) -> Splines:
        from scipy.interpolate import CubicSpline

        return with_derivatives(CubicSpline(self.times, self.positions, axis=0))

    @classmethod
    def from_csv(cls, path: str | Path) -> RecordedMotion:
        """Read ``t, q_1, ..., q_n`` ([s], [rad]), a row a sample; a first row of names is skipped.

        Raises
        ------
        ArgumentError
            A file that is missing; a line with an empty or unreadable cell, or with more or fewer
            cells than the first; what the constructor refuses.
        """
        table = np.array(_rows(Path(path)))
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

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        return held(t, np.asarray(self.times), self._splines)


def _rows(path: Path) -> list[list[float]]:
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
    rows: list[list[float]] = []
    for number, (line, cells) in enumerate(lines):
        values = [_number(cell) for cell in cells]
        if number == 0 and all(value is None for value in values):
            continue
        width = len(rows[0]) if rows else len(values)
        if len(values) != width:
            raise ArgumentError(f"{_end(path)}, line {line}", f"{width} cells", f"{len(values)}")
        for column, value in enumerate(values, start=1):
            if value is None:
                got = repr(cells[column - 1]) if cells[column - 1].strip() else "an empty cell"
                raise ArgumentError(f"{_end(path)}, line {line}, column {column}", "a number", got)
        rows.append([value for value in values if value is not None])
    if len(rows) < 2:
        raise ArgumentError(f"{path}", "at least two rows of numbers", f"{len(rows)}")
    return rows


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _end(path: object) -> str:
    # The file's own name: the line and the column after it are not to be cut off.
    text = str(path)
    return text if len(text) <= _PATH else f"...{text[-_PATH:]}"
