"""Reference trajectories through points: quintic moves, splines through waypoints, recordings."""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import FloatArray
from fpid_pin.descriptions import described
from fpid_pin.exceptions import ArgumentError
from fpid_pin.simulation.references import Motion

METHODS = ("cubic", "quintic")
#: A recording whose step is this many times the median has lost something.
GAP = 10.0


@described("quintic", "Reference")
@dataclass(frozen=True, eq=False)
class Quintic:
    """From one pose to another, at rest at both ends: the minimum-jerk move.

    ``q = start + (end - start) (10 x^3 - 15 x^4 + 6 x^5)``, x = (t - begin)/duration, which is at
    rest, with no acceleration, at x = 0 and 1 (Flash and Hogan, Journal of Neuroscience 5, 1985).
    Before and after it holds.

    Parameters
    ----------
    start, end
        Scalar or (n,) [rad].
    duration
        Of the move [s].
    begin
        When it starts [s].
    """

    start: ArrayLike
    end: ArrayLike
    duration: float
    begin: float = 0.0

    def __post_init__(self) -> None:
        for name in ("start", "end"):
            array = checks.floats(f"reference.{name}", getattr(self, name), max_ndim=1)
            object.__setattr__(self, name, array)
        lengths = {len(a) for a in (self.start, self.end) if np.ndim(a)}  # type: ignore[arg-type]
        if len(lengths) > 1:
            shapes = f"shapes {np.shape(self.start)} and {np.shape(self.end)}"
            raise ArgumentError("reference.start, end", "one length", shapes)
        duration = checks.number("reference.duration", self.duration, above=0.0)
        object.__setattr__(self, "duration", duration)
        object.__setattr__(self, "begin", checks.number("reference.begin", self.begin))

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        x = np.clip((t - self.begin) / self.duration, 0.0, 1.0)
        part = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        bend = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        start = np.atleast_1d(np.asarray(self.start))
        way = np.atleast_1d(np.asarray(self.end)) - start
        return start + np.multiply.outer(part, way), np.outer(rate, way), np.outer(bend, way)


@described("waypoints", "Reference")
@dataclass(frozen=True, eq=False)
class Waypoints:
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

    times: ArrayLike
    positions: ArrayLike
    method: str = "cubic"
    _splines: tuple[Any, Any, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        checks.choice("reference.method", self.method, METHODS)
        times, positions = _points(self.times, self.positions)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        # Imported here: scipy.interpolate would be a third of the package's import time.
        from scipy.interpolate import CubicSpline, make_interp_spline

        if self.method == "cubic":
            spline = CubicSpline(times, positions, axis=0, bc_type="clamped")
        else:
            still = np.zeros(positions.shape[1])
            rest = [(1, still), (2, still)]
            spline = make_interp_spline(times, positions, k=5, bc_type=(rest, rest))
        object.__setattr__(self, "_splines", _derivatives(spline))

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        return _held(t, np.asarray(self.times), self._splines)


@described("recorded", "Reference")
@dataclass(frozen=True, eq=False)
class RecordedMotion:
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

    times: ArrayLike
    positions: ArrayLike
    _splines: tuple[Any, Any, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        times, positions = _points(self.times, self.positions)
        steps = np.diff(times)
        widest = int(np.argmax(steps))
        if steps[widest] > GAP * np.median(steps):
            raise ArgumentError(
                f"reference.times.{widest + 1}",
                f"a step like the others ({np.median(steps):.3g} s)",
                f"a gap of {steps[widest]:.3g} s after t = {times[widest]:g} s",
            )
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        from scipy.interpolate import CubicSpline

        object.__setattr__(self, "_splines", _derivatives(CubicSpline(times, positions, axis=0)))

    @classmethod
    def from_csv(cls, path: str | Path) -> RecordedMotion:
        """Read ``t, q_1, ..., q_n`` ([s], [rad]), a row a sample; a first row of names is skipped.

        Raises
        ------
        ArgumentError
            A file that is missing; a line with an empty or unreadable cell, or with more or fewer
            cells than the first; what the constructor refuses.
        """
        rows = _rows(Path(path))
        table = np.array(rows)
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
        return _held(t, np.asarray(self.times), self._splines)


def _points(times: ArrayLike, positions: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Check times (K,) and positions (K, n)."""
    t = checks.floats("reference.times", times, max_ndim=1)
    try:
        q = checks.floats("reference.positions", positions, max_ndim=2)
    except ArgumentError as error:
        if isinstance(positions, (list, tuple)) and len({np.size(row) for row in positions}) > 1:
            sizes = [int(np.size(row)) for row in positions]
            odd = next(k for k, size in enumerate(sizes) if size != sizes[0])
            raise ArgumentError(
                f"reference.positions.{odd}", f"{sizes[0]} angles, as in the first row",
                f"{sizes[odd]}",
            ) from None  # fmt: skip
        raise error
    if t.ndim != 1 or len(t) < 2:
        raise ArgumentError("reference.times", "at least two times", f"shape {t.shape}")
    if q.ndim != 2 or len(q) != len(t):
        raise ArgumentError(
            "reference.positions", f"shape ({len(t)}, n), a row for each time", f"shape {q.shape}"
        )
    backward = np.flatnonzero(np.diff(t) <= 0.0)
    if backward.size:
        k = int(backward[0]) + 1
        raise ArgumentError(
            f"reference.times.{k}", f"a time after the one before ({t[k - 1]:g} s)", f"{t[k]:g} s"
        )
    return t, q


def _derivatives(spline: Any) -> tuple[Any, Any, Any]:
    return spline, spline.derivative(1), spline.derivative(2)


def _held(t: FloatArray, times: FloatArray, splines: tuple[Any, Any, Any]) -> Motion:
    """Sample splines within `times`; beyond them the ends hold, at rest."""
    inside = np.clip(t, times[0], times[-1])
    q, v, a = (np.array(spline(inside), dtype=np.float64) for spline in splines)
    # A sample may fall a rounding error beside the instant it stands for.
    slack = 1e-9
    outside = (t < times[0] - slack) | (t > times[-1] + slack)
    v[outside] = 0.0
    a[outside] = 0.0
    return q, v, a


def _rows(path: Path) -> list[list[float]]:
    """Read the numbers of a CSV file; an error names the line."""
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = [(k, row) for k, row in enumerate(csv.reader(file), start=1) if any(row)]
    except FileNotFoundError:
        raise ArgumentError(f"{path}", "a CSV file", "no such file") from None
    except (OSError, UnicodeDecodeError, csv.Error):
        raise ArgumentError(f"{path}", "a CSV file", "something that is not text") from None
    rows: list[list[float]] = []
    for number, (line, cells) in enumerate(lines):
        values = [_number(cell) for cell in cells]
        if number == 0 and all(value is None for value in values):
            continue
        width = len(rows[0]) if rows else len(values)
        if len(values) != width:
            raise ArgumentError(f"{path}, line {line}", f"{width} cells", f"{len(values)}")
        for column, value in enumerate(values, start=1):
            if value is None:
                got = repr(cells[column - 1]) if cells[column - 1].strip() else "an empty cell"
                raise ArgumentError(f"{path}, line {line}, column {column}", "a number", got)
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
