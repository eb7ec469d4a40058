"""What a reference is, a trajectory for the joints: by formulas, through points, as recorded."""

import csv
import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike

from fpid_pin import checks
from fpid_pin.checks import Array, Check, FloatArray, Number, OneOf, PerJoint, Text
from fpid_pin.descriptions import Description, described
from fpid_pin.exceptions import ArgumentError

#: A recording whose step is this many times the median has lost something.
GAP = 10.0
#: Angles, rates and accelerations.
Motion = tuple[FloatArray, FloatArray, FloatArray]


@runtime_checkable
class Reference(Protocol):
    """A trajectory of one robot; anything with this method will do."""

    def sample(self, t: FloatArray) -> Motion:
        """Return angles [rad], rates [rad/s] and accelerations [rad/s^2] at times `t`.

        Parameters
        ----------
        t
            Times [s], (K,).

        Returns
        -------
        tuple of ndarray
            Three arrays (K, n), or (K, 1) where all joints do the same.
        """
        ...


@described("hold", "Reference")
@dataclass(frozen=True, eq=False)
class Hold(Description):
    """Stay at a position: regulation.

    Parameters
    ----------
    position
        Scalar or (n,) [rad].
    """

    position: Annotated[ArrayLike, PerJoint("rad")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        q = np.zeros((len(t), 1)) + np.atleast_1d(np.asarray(self.position))
        return q, np.zeros_like(q), np.zeros_like(q)


@described("sinusoid", "Reference")
@dataclass(frozen=True, eq=False)
class Sinusoid(Description):
    """``q_d = offset + amplitude sin(frequency t + phase)``, each a scalar or (n,).

    Parameters
    ----------
    amplitude
        [rad].
    frequency
        [rad/s].
    phase
        [rad].
    offset
        [rad].
    """

    amplitude: Annotated[ArrayLike, PerJoint("rad")] = 1.0
    frequency: Annotated[ArrayLike, PerJoint("rad/s")] = 1.0
    phase: Annotated[ArrayLike, PerJoint("rad")] = 0.0
    offset: Annotated[ArrayLike, PerJoint("rad")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        amplitude, frequency = np.asarray(self.amplitude), np.asarray(self.frequency)
        angle = np.multiply.outer(t, np.atleast_1d(frequency)) + self.phase
        q = self.offset + amplitude * np.sin(angle)
        v = amplitude * frequency * np.cos(angle)
        a = -amplitude * frequency**2 * np.sin(angle)
        return q, v, a


@described("quintic", "Reference")
@dataclass(frozen=True, eq=False)
class Quintic(Description):
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

    start: Annotated[ArrayLike, PerJoint("rad")]
    end: Annotated[ArrayLike, PerJoint("rad")]
    duration: Annotated[float, Number("s", above=0.0)]
    begin: Annotated[float, Number("s")] = 0.0

    def sample(self, t: FloatArray) -> Motion:
        """See `Reference.sample`."""
        x = np.clip((t - self.begin) / self.duration, 0.0, 1.0)
        part = x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
        rate = 30.0 * x**2 * (1.0 - x) ** 2 / self.duration
        acceleration = 60.0 * x * (1.0 - x) * (1.0 - 2.0 * x) / self.duration**2
        start = np.atleast_1d(np.asarray(self.start))
        way = np.atleast_1d(np.asarray(self.end)) - start
        q = start + np.multiply.outer(part, way)
        return q, np.outer(rate, way), np.outer(acceleration, way)


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
        times, shape = checks.times("reference.times", self.times), np.shape(self.positions)
        if len(times) != shape[0]:
            expected = f"shape ({len(times)}, n), a row for each time"
            raise ArgumentError("reference.positions", expected, f"shape {shape}")

    def _spline(self, ends: str = "not-a-knot") -> Any:
        # Imported here: scipy.interpolate would be a third of the package's import time.
        from scipy.interpolate import CubicSpline

        return CubicSpline(self.times, self.positions, axis=0, bc_type=ends)

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

    def _spline(self, ends: str = "clamped") -> Any:
        from scipy.interpolate import make_interp_spline

        if self.method == "cubic":
            return super()._spline(ends)
        still = np.zeros(np.shape(self.positions)[1])
        rest = [(1, still), (2, still)]
        return make_interp_spline(self.times, self.positions, k=5, bc_type=(rest, rest))


@described("recorded", "Reference")
@dataclass(frozen=True, eq=False)
class RecordedMotion(_Points):
    """A recorded motion of the joints, repeated through a cubic spline.

    Parameters
    ----------
    times
        [s], (K,), increasing, without gaps; before the first and after the last it holds.
    positions
        [rad], (K, n).
    path
        In place of both, a CSV file with rows of ``t, q_1, ..., q_n``; a first row of names is
        skipped. A saved run holds the motion itself, so it needs no file.

    Raises
    ------
    ArgumentError
        Times that do not increase; a step more than ten times the median (a gap). A file that is
        missing; a line with an empty or unreadable cell, or with more or fewer cells than the
        first.
    """

    times: Annotated[ArrayLike, Array("s", shape=(None,))] = None  # type: ignore[assignment]
    positions: Annotated[ArrayLike, Check(_check_rows, "rad")] = None  # type: ignore[assignment]
    path: Annotated[str | None, Text] = None

    def __post_init__(self) -> None:
        if self.path is not None:
            if self.times is not None or self.positions is not None:
                raise ArgumentError("reference", "path alone", "path with times or positions")
            table = _read_csv(self.path)
            self._set(times=table[:, 0], positions=table[:, 1:], path=None)
        elif self.times is None:
            raise ArgumentError("reference.times", "a value (or path, a CSV file)", "none")
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


def _read_csv(path: str) -> FloatArray:
    """Read the numbers of a CSV file; an error names line and column."""
    if not Path(path).is_file():
        # Nor a device, which may have no end.
        raise ArgumentError(path, "a CSV file", "no file")
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            lines = [(k, row) for k, row in enumerate(csv.reader(file), start=1) if any(row)]
    except (OSError, UnicodeDecodeError, csv.Error):
        raise ArgumentError(path, "a CSV file", "something that is not text") from None
    if lines and all(_number(cell) is None for cell in lines[0][1]):
        del lines[0]
    rows = []
    for line, cells in lines:
        if len(cells) != len(lines[0][1]):
            expected = f"{len(lines[0][1])} cells in line {line}"
            raise ArgumentError(path, expected, f"{len(cells)}")
        rows.append([_number(cell) for cell in cells])
        if None in rows[-1]:
            column = rows[-1].index(None)
            got = repr(cells[column]) if cells[column].strip() else "an empty cell"
            raise ArgumentError(path, f"a number in line {line}, column {column + 1}", got)
    table = np.array(rows, dtype=np.float64)
    if table.ndim != 2 or table.shape[1] < 2:
        raise ArgumentError(path, "rows of t, q_1, ..., q_n", f"an array of shape {table.shape}")
    return table


def _number(cell: str) -> float | None:
    try:
        value = float(cell)
    except ValueError:
        return None
    return value if math.isfinite(value) else None
