"""What a command leaves behind of its runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from fpid_pin import checks
from fpid_pin.extras import installed
from fpid_pin.simulation import Run

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Keep:
    """Options of the commands that simulate.

    Parameters
    ----------
    runs
        Whether runs are saved; compressed where pcodec is installed.
    figures
        Whether figures are drawn.
    png
        Whether as PNG, too.
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
    png: bool = False

    def __post_init__(self) -> None:
        checks.integer("--every", self.every, low=1)

    def save(self, run: Run, path: Path) -> None:
        """Save a run, if runs are kept."""
        if self.runs:
            run.save(path, compressed=installed("pcodec"), every=self.every)

    def draw(self, figures: Mapping[str, Figure], folder: Path) -> dict[str, bytes]:
        """Write figures, each drawn once, and return them as SVG: what a report shows."""
        from fpid_pin.view.style import figure_bytes

        drawn = {name: figure_bytes(figure, "svg") for name, figure in figures.items()}
        for name, svg in drawn.items():
            (folder / f"{name}.svg").write_bytes(svg)
            if self.png:
                (folder / f"{name}.png").write_bytes(figure_bytes(figures[name], "png"))
        return drawn


#: What a command keeps that was not told otherwise.
ALL = Keep()
