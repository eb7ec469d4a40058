"""The progress of a search: generation, best cost, evaluations a second, time left."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from fpid_pin.tuning import SearchProgress
from fpid_pin.tuning.settings import SearchCallback

_QUIET = 10.0  # s between lines where there is no terminal to draw a bar on


@contextmanager
def search_bar() -> Iterator[SearchCallback]:
    """Give a function that shows a `SearchProgress`: a bar on a terminal, else lines at times."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True)
    bar = Progress(
        TextColumn("generation {task.fields[generation]}"),
        BarColumn(),
        TextColumn("{task.fields[told]}"),
        console=console,
        transient=True,
        disable=not console.is_terminal,
    )
    task = bar.add_task("tune", total=1.0, generation="", told="")
    last = time.monotonic() - _QUIET

    def tell(progress: SearchProgress) -> None:
        nonlocal last
        generation = f"{progress.generation} of {progress.generations}"
        best = f"best {progress.best:.5g}, " if np.isfinite(progress.best) else ""
        left = "" if np.isnan(progress.seconds_left) else f", {_clock(progress.seconds_left)} left"
        told = f"{best}{progress.rate:.1f} evaluations/s{left}"
        if console.is_terminal:
            bar.update(task, completed=progress.part, generation=generation, told=told)
        elif time.monotonic() - last >= _QUIET and progress.rate > 0.0:
            last = time.monotonic()
            console.print(f"generation {generation}: {told}", highlight=False)

    with bar:
        yield tell


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
