"""The progress of a search: generation, best cost, evaluations a second, time left."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from fpid_pin.tuning import Report

_QUIET = 10.0  # s between lines where there is no terminal to draw a bar on


@contextmanager
def search_bar() -> Iterator[Callable[[Report], None]]:
    """Give a function that takes a `Report`: a bar on a terminal, else a line now and then."""
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

    def tell(report: Report) -> None:
        nonlocal last
        generation = f"{report.generation} of {report.generations}"
        best = f"best {report.best:.5g}, " if np.isfinite(report.best) else ""
        left = "" if np.isnan(report.seconds_left) else f", {_clock(report.seconds_left)} left"
        told = f"{best}{report.rate:.1f} evaluations/s{left}"
        if console.is_terminal:
            bar.update(task, completed=report.part, generation=generation, told=told)
        elif time.monotonic() - last >= _QUIET and report.rate > 0.0:
            last = time.monotonic()
            console.print(f"generation {generation}: {told}", highlight=False)

    with bar:
        yield tell


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
