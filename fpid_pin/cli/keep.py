"""What a command leaves behind of its runs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from fpid_pin import checks
from fpid_pin.simulation import Run


@dataclass(frozen=True)
class Keep:
    """Options of `run` and `compare`.

    Parameters
    ----------
    runs
        Whether runs are saved; compressed.
    figures
        Whether figures are drawn.
    every
        One row of a run in so many is saved; tables and figures are of all rows.

    Raises
    ------
    ArgumentError
        `every` is no whole number from 1 on.
    """

    runs: bool = True
    figures: bool = True
    every: int = 1

    def __post_init__(self) -> None:
        checks.integer("--every", self.every, low=1)

    def save(self, run: Run, path: Path) -> None:
        """Save a run, if runs are kept."""
        if self.runs:
            run.save(path, compressed=True, every=self.every)


#: What a command keeps that was not told otherwise.
ALL = Keep()
