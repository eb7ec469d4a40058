"""A progress bar for work that takes longer than a person likes to wait in the dark."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import numpy as np

from fpid_pin.progress import Progress
from fpid_pin.tuning import SearchProgress

#: A bar is worth showing after so long [s]; most work of two seconds is past it at 25 %.
_PATIENCE = 0.5
#: Between lines of a search where there is no terminal to draw a bar on [s].
_QUIET = 10.0


def say_if_compiling() -> None:
    """Say on standard error, once on a machine, why the first run takes longer."""
    # Imported late: it loads numba.
    from fpid_pin.kernels.compiled import is_cold

    if is_cold():
        sys.stderr.write("fpid-pin: compiling the equations for this machine, some seconds, once\n")


@contextmanager
def progress_bar(title: str) -> Iterator[Callable[[Progress], None]]:
    """Give a function that takes a `Progress` and draws a bar on standard error.

    Of a `SearchProgress` it says the generation, the best cost, evaluations a second and the time
    left; where there is no terminal in lines, at times.
    """
    from rich import progress as rich
    from rich.console import Console

    console = Console(stderr=True)
    bar = rich.Progress(
        rich.TextColumn("{task.description}"), rich.BarColumn(),
        rich.TextColumn("{task.fields[told]}"), console=console, transient=True,
    )  # fmt: skip
    task = bar.add_task(title, total=1.0, told="")
    began = time.monotonic()
    last = began - _QUIET

    def advance(progress: Progress) -> None:
        nonlocal last
        now, part, head = time.monotonic(), progress.part, title
        told = (
            f"{100.0 * part:3.0f} %, {_clock((now - began) * (1.0 / max(part, 0.01) - 1.0))} left"
        )
        if isinstance(progress, SearchProgress):
            head, told = (
                f"generation {progress.generation} of {progress.generations}",
                _told(progress),
            )
            if not console.is_terminal and now - last >= _QUIET and progress.rate > 0.0:
                last = now
                console.print(f"{head}: {told}", highlight=False)
        if not bar.live.is_started and now - began > _PATIENCE and part < 1.0:
            bar.start()
        bar.update(task, completed=part, description=head, told=told)

    try:
        yield advance
    finally:
        if bar.live.is_started:
            bar.stop()


def _told(progress: SearchProgress) -> str:
    best = f"best {progress.best:.5g}, " if np.isfinite(progress.best) else ""
    left = "" if np.isnan(progress.seconds_left) else f", {_clock(progress.seconds_left)} left"
    return f"{best}{progress.rate:.1f} evaluations/s{left}"


def _clock(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
